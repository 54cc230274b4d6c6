"""The command line `jaxdyn`: all its commands, with examples."""

from jaxdyn.cli.accuracy import accuracy_command
from jaxdyn.cli.chaos import chaos_command
from jaxdyn.cli.course import course_command
from jaxdyn.cli.equations import equations_command
from jaxdyn.cli.fit import fit_command
from jaxdyn.cli.gallery import gallery_command
from jaxdyn.cli.hard import hard_command
from jaxdyn.cli.info import info_command
from jaxdyn.cli.list import list_command
from jaxdyn.cli.run import run_command
from jaxdyn.cli.shared import add, application, start
from jaxdyn.cli.vibration import vibration_command

app = application("Simulate, draw and check the scenes of a course on dynamics.")
add(
    *(app, "list", list_command),
    *("jaxdyn list", "jaxdyn list cannonball", "jaxdyn list --problems"),
)
add(
    *(app, "run", run_command),
    "jaxdyn run cannonball --set drag=0.05 --t1 2 --plot cannonball.png",
    "jaxdyn run pendulum --set angle=2*pi/3 --series angle.png --csv angle.csv",
    "jaxdyn run cylinder_on_cylinder --t1 2 --animate fall.gif --seconds 4",
    "jaxdyn run double_pendulum --play",
    "jaxdyn run double_pendulum --live double_pendulum.html",
    "jaxdyn run three_body --solver stoermer14 --rtol 1e-13",
)
add(
    *(app, "fit", fit_command),
    "jaxdyn fit pendulum track.csv --free g --free damping --plot fit.png",
    "jaxdyn fit mine.py:spring track.csv --free k=20 --set m=0.5 --start x",
)
add(
    *(app, "accuracy", accuracy_command),
    "jaxdyn accuracy three_body --digits 12 --plot work.png",
)
add(
    *(app, "chaos", chaos_command),
    "jaxdyn chaos lorenz --t1 5000",
    "jaxdyn chaos double_pendulum --map theta1=0:pi --map theta2=0:pi --plot chaos.png",
)
add(
    *(app, "vibration", vibration_command),
    "jaxdyn vibration double_pendulum --set angles=0.1,0",
    "jaxdyn vibration oscillator --set c=0.2 --input x --output x --within 0.1,10 --plot bode.png",
)
add(
    *(app, "equations", equations_command),
    *("jaxdyn equations double_pendulum", "jaxdyn equations pendulum --latex"),
    "jaxdyn equations lorenz --code javascript",
)
add(
    *(app, "hard", hard_command),
    *("jaxdyn hard --list", "jaxdyn hard pythagorean"),
)
add(
    *(app, "course", course_command),
    *("jaxdyn course 16", "jaxdyn course figure_eight --plot eight.png --code"),
)


add(
    *(app, "gallery", gallery_command),
    *("jaxdyn gallery --out site", "jaxdyn gallery --only 28,31"),
)
add(app, "info", info_command, "jaxdyn info", "jaxdyn info --json")


def main() -> None:
    """Run the command line."""
    start(app)
