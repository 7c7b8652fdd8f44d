"""The command line of a stage as a user calls it by hand."""

import argparse
from typing import NoReturn


class CommandLine(argparse.ArgumentParser):
    """A parser that refuses wrong arguments in one line; its subparsers are such, too."""

    def error(self, message: str) -> NoReturn:
        """End with exit status 2 and one line."""
        self.exit(2, f"{self.prog}: {' '.join(message.split())}; --help lists its arguments\n")
