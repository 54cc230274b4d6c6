"""How forces move coordinates: one file a formulation."""
