"""The command line `orbits`: all its commands, with examples."""

from jaxdyn.cli.shared import add, application, start
from orbits.cli.aim import aim_command
from orbits.cli.basins import basins_command
from orbits.cli.bifurcations.curve import curve_command
from orbits.cli.bifurcations.diagram import diagram_command
from orbits.cli.bifurcations.family import family_command
from orbits.cli.figure_eight import figure_eight_command
from orbits.cli.find import find_command
from orbits.cli.loops import loops_command
from orbits.cli.manifold import manifold_command
from orbits.cli.prove import prove_command, refine_command
from orbits.cli.responses import backbone_command, response_command
from orbits.cli.search import search_command
from orbits.cli.section import section_command
from orbits.cli.show import show_command
from orbits.cli.verify import verify_command

app = application("Periodic orbits: find them, identify them, verify them.")
add(
    app,
    "find",
    find_command,
    "orbits find pendulum --set angle=2 --plot swing.png --save swing.json",
    "orbits find three_body --closing choreography",
)
add(
    app,
    "family",
    family_command,
    "orbits family pendulum --set angle=1 --plot swings.png",
    "orbits family lorenz --set rho=160 --set t1=10 --parameter rho --down --within 140,161",
)
add(
    app,
    "diagram",
    diagram_command,
    "orbits diagram lorenz --parameter rho --start 0,0,0 --set rho=0.5 --within 0,30 "
    "--plot lorenz.png",
)
add(
    app,
    "curve",
    curve_command,
    "orbits curve lorenz --parameters rho,sigma --start 7,7,19 --set rho=20 "
    "--within 10,40 --within2 5,20 --plot hopf.png",
)
add(
    app,
    "response",
    response_command,
    "orbits response two_springs --set g=0 --set c_d=0.3 --set length_a=0.8 --set length_b=0.8 "
    "--start 0,0,0,0 --drive y --within 1,5 --levels 0.5,1.5 --output y --plot response.png",
)
add(
    app,
    "backbone",
    backbone_command,
    "orbits backbone double_pendulum --set angles=0,0 --mode 2 --energy 1 --plot backbone.png",
)
add(
    app,
    "basins",
    basins_command,
    "orbits basins lorenz --set rho=20 --grid x=-20:20:60 --grid z=0:40:60 --plot basins.png",
    "orbits basins lorenz --grid x=-5:5:10 --grid y=-5:5:10 --along rho 0.5 2 --plot tipping.png",
)
add(app, "aim", aim_command, "orbits aim --speed 50 --drag 0.01 --x 80 --plot throws.png")
add(
    app,
    "loops",
    loops_command,
    "orbits loops --plot loops.png",
    "orbits loops --n=-1 --turns 2 --loops 3 --plot one.png",
)
add(
    app,
    "manifold",
    manifold_command,
    "orbits manifold swing.json --kind unstable --time 10 --plot tubes.png",
)
add(app, "search", search_command, "orbits search --samples 2048 --table plane.jsonl")
add(
    app,
    "section",
    section_command,
    "orbits section henon_heiles --event x=0 --energy 1/12,1/8,1/6 --starts y=-0.4:0.6:24 "
    "--plot section.png",
    "orbits section shaken_pendulum --event every=2*pi/60 --starts theta=0:3:16 --plot shaken.png",
)
add(
    app,
    "figure-eight",
    figure_eight_command,
    "orbits figure-eight --plot figure-eight.png",
)
add(app, "refine", refine_command, "orbits refine swing.json --digits 50")
add(app, "prove", prove_command, "orbits prove swing.json --json")
add(
    app,
    "show",
    show_command,
    "orbits show swing.json",
    "orbits show swings.json --plot swings.png",
    "orbits show swing.json --live swing.html",
)
add(app, "verify", verify_command, "orbits verify swing.json")


def main() -> None:
    """Run the command line."""
    start(app)
