"""The command line `jaxdyn`: all its commands."""

from jaxdyn.cli import shared
from jaxdyn.cli.accuracy import accuracy_command
from jaxdyn.cli.hard import hard_command
from jaxdyn.cli.list import list_command
from jaxdyn.cli.run import run_command

app = shared.application("Simulate, draw and check the scenes of a course on dynamics.")
app.command("list")(list_command)
app.command("run")(run_command)
app.command("accuracy")(accuracy_command)
app.command("hard")(hard_command)


def main() -> None:
    """Run the command line."""
    shared.run(app)
