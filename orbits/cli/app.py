"""The command line `orbits`: all its commands."""

from jaxdyn.cli import shared
from orbits.cli.aim import aim_command
from orbits.cli.family import family_command
from orbits.cli.figure_eight import figure_eight_command
from orbits.cli.find import find_command
from orbits.cli.loops import loops_command
from orbits.cli.search import search_command
from orbits.cli.verify import verify_command

app = shared.application("Periodic orbits: find them, identify them, verify them.")
app.command("find")(find_command)
app.command("family")(family_command)
app.command("aim")(aim_command)
app.command("loops")(loops_command)
app.command("search")(search_command)
app.command("figure-eight")(figure_eight_command)
app.command("verify")(verify_command)


def main() -> None:
    """Run the command line."""
    shared.run(app)
