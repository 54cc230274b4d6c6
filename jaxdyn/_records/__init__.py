"""Records: parts of a scene that are pytrees, and remember what their functions captured.

`record` has the class, and how it is pickled; `captured` finds in the code of the user's functions
which numbers they captured, and whether these have changed since; `notes` keeps what was found out
about a record. `repeated` decides whether functions depend on their arguments alone. `kinds` checks
that the first argument of a public function is a record, or another result, of the right kind;
`labelled` makes tables of pandas and data sets of xarray from results.

May import: `_text`.

To add a kind of record, write a subclass of `Record`; an entry point that takes one calls its
`check_functions`.
"""
