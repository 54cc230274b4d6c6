"""What a command shows while it works: a line on a terminal, nothing elsewhere."""

import io
import sys

import pytest

from jaxdyn._progress import each, report_progress
from jaxdyn.cli.screen import screen


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def terminal(monkeypatch):
    """Makes standard error a terminal; within the test, since pytest exchanges it before."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")

    def made():
        shown = Terminal()
        monkeypatch.setattr(sys, "stderr", shown)
        return shown

    return made


def test_a_terminal_sees_what_is_done_from_the_start(terminal, capsys, monkeypatch):
    shown, seen = terminal(), []
    monkeypatch.setattr("jaxdyn.configure", lambda: seen.append(shown.getvalue()))
    with screen("simulating car") as out:
        out.print("[bold]a result[/bold]")
        report_progress("testing stability")
        out._live.refresh()
        for _ in each(range(4), "drawing frames"):
            out._live.refresh()
    assert "simulating car" in seen[0]  # before JAX is loaded
    assert "testing stability" in shown.getvalue()
    assert "drawing frames" in shown.getvalue()
    assert "3 of 4" in shown.getvalue()
    assert shown.getvalue().endswith("\x1b[2K")  # gone in the end
    assert capsys.readouterr().out == "a result\n"


def test_compiling_is_said(terminal):
    shown = terminal()
    with screen("simulating car") as out:
        out._live.clock._heard.busy = True
        out._live.refresh()
        out._live.clock._heard.busy = False
    assert "compiling" in shown.getvalue()


@pytest.mark.parametrize("case", ["json", "file", "dumb"])
def test_elsewhere_there_is_no_line(terminal, monkeypatch, case, capsys):
    if case == "file":
        monkeypatch.setattr(Terminal, "isatty", lambda self: False)
    if case == "dumb":
        monkeypatch.setenv("TERM", "dumb")
    shown = terminal()
    with screen("simulating car", as_object=case == "json") as out:
        report_progress("drawing", 1, 2)
        out.result({"a": 1})
    assert shown.getvalue() == ""
    assert capsys.readouterr().out == '{"a": 1}\n'


def test_an_error_ends_the_line(terminal):
    shown = terminal()
    with pytest.raises(ValueError, match="of mine"), screen("simulating car"):
        raise ValueError("of mine")
    assert shown.getvalue().endswith("\x1b[2K")
