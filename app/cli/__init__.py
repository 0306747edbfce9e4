"""The command line: `pgraph` opens the page, `pgraph COMMAND` answers in the terminal."""

from .main import main as main
