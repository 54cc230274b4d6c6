"""What was found: the stability, identity, derivatives and topology of an orbit.

`stability` decides what is stable, from the `monodromy`; `identity` says which orbit it is, `same`
and `alignment` whether two are one, `words` their topology; `sensitivity` has the derivatives by
the parameters of the scene, `evidence` second opinions, `report` all of it as a record.

May import: `shooting`.

One more analysis is one file that takes an `Orbit`, a line in ``orbits/__init__.pyi``, and a claim
in `report` if files and commands are to state it.
"""
