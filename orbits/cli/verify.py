"""The command `orbits verify`: recomputes every claim of an orbit file."""

import orbits
from jaxdyn._text import fail
from jaxdyn.cli.screen import screen
from jaxdyn.cli.shared import JsonOption, SetOption
from orbits.cli.printed import print_reports
from orbits.cli.shared import OrbitFile, SceneOfFile, scene_of_file

#: Messages about the records of a file that are computed again, besides its claims.
_REPEATED = {
    "refined": "the digits were computed again, and are the same",
    "certificate": "the proof was repeated in ball arithmetic, and holds",
}


def verify_command(
    file: OrbitFile,
    scene: SceneOfFile = None,
    settings: SetOption = None,
    as_object: JsonOption = False,
) -> None:
    """Recompute every claim of an orbit file, from its scene, start and period alone."""
    with screen(f"recomputing the claims of {file}", as_object) as out:
        given = scene_of_file(scene, settings)
        derived, mismatches = orbits.verify(file, scene=given)
        orbit, claims = orbits.load(file, scene=given)
        again = [name for name in _REPEATED if claims.get(name, {}).get("proved", name in claims)]
        if as_object:
            wrong = [
                {"name": m.name, "claimed": m.claimed, "derived": m.derived} for m in mismatches
            ]
            answer = {"ok": not wrong, "mismatches": wrong}
            out.result(answer | {"repeated": again, "derived": orbits.analysis.as_json(derived)})
        else:
            print_reports({file.name: derived}, out, orbit)
        if mismatches:
            first = mismatches[0]
            raise fail(
                str(file),
                f"claims that hold, {first.name} = {first.derived}",
                f"{first.claimed}",
                f"These do not hold: {', '.join(m.name for m in mismatches)}. The file was edited.",
            )
        for name in again:
            out.print(_REPEATED[name])
        out.show_task("counting the certain digits, by another integrator")
        standing = orbits.digits(orbit)
        out.print(
            f"every claim of the file holds; by another integrator {standing.period:.1f} digits "
            f"of the period and {standing.y0:.1f} of the start may be claimed"
        )
