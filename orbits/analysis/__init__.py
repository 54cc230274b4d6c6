"""What was found: its stability, identity, derivatives, topology, and the evidence for it.

`stability` decides what is stable, from the `monodromy`; `identity` says which orbit it is,
`same` and `alignment` whether two are one, `words` their topology, `sensitivity` has derivatives
in the numbers of the scene, `evidence` second opinions, `report` all of it as a record.

May import: `shooting` and what is below it.
"""
