"""The command line interface: `pgraph` opens the page, `pgraph COMMAND` runs in the terminal."""

from .main import main as main
