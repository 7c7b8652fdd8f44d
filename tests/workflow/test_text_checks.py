"""Spelling, the form of the Snakefiles, and the hooks that check both before a commit."""

import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from tiny_mines import ROOT

TOOLS = Path(sys.executable).parent


@pytest.mark.parametrize("command", ["codespell", "snakefmt --check ."])
def test_texts_and_snakefiles_pass_their_check(command):
    tool, *options = shlex.split(command)
    done = subprocess.run([TOOLS / tool, *options], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_hook_runs_a_tool_of_the_environment():
    """A hook from another repository would bring a second version of a tool, and ask the network for it."""
    (local,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    assert local["repo"] == "local"
    for hook in local["hooks"]:
        program = Path(shlex.split(hook["entry"])[0])
        assert program.parent == Path(".venv/bin"), hook["id"]
        assert (TOOLS / program.name).exists(), hook["id"]
