"""Records: parts of a scene that are pytrees, and remember what their functions captured.

`record` is the class, with how it is pickled; `captured` finds in the code of the user's functions
which numbers they captured, and whether these have changed since; `notes` keeps what was found out
about one. `repeated` tells whether functions depend on their arguments alone. `kinds` checks which
record, or other result, a public function is given first; `labelled` makes tables of pandas and
data sets of xarray from results.

May import: `_text`.

One more kind of record is a subclass of `Record`; an entry point that is given one calls its
`check_functions`.
"""
