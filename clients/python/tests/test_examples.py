"""The examples and the notebook run as they are, and the README's lines as printed."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

import palpate

EXAMPLES = Path(__file__).parent.parent / "examples"
ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("01_next_contact.py", r"touch at \[.*\] m, from .* towards"),
        ("02_controller_loop.py", r"STOP_REASON_BUDGET after 25 attempts[^\0]*\n0\.\d\d mm from the truth"),
        ("03_compare_strategies.py", r"PROACTIVE +15[^\0]*RANDOM +15"),
        ("04_rerun.py", r"ball.rrd has 17 revisions"),
        ("05_depth_image.py", r"0\.\d\d mm from the truth after 20 attempts"),
    ],
)
def test_an_example_says_what_it_found(name: str, says: str, server: palpate.LocalServer, tmp_path: Path) -> None:
    command = [sys.executable, str(EXAMPLES / name), server.url]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr
    assert re.search(says, run.stdout), run.stdout
    if name == "04_rerun.py":
        assert (tmp_path / "ball.rrd").stat().st_size > 100_000


def test_an_example_without_a_server_says_how_to_start_one() -> None:
    command = [sys.executable, str(EXAMPLES / "01_next_contact.py"), "http://127.0.0.1:9"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert run.returncode != 0
    assert "palpate serve" in run.stderr


def test_the_notebook_runs_and_has_its_pictures() -> None:
    notebook = nbformat.read(EXAMPLES / "quickstart.ipynb", as_version=4)  # type: ignore[no-untyped-call]
    NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 3
    assert re.search(r"mean error 0\.\d\d mm", "".join(output.get("text", "") for output in outputs))


@pytest.mark.parametrize(
    "file", [ROOT / "README.md", ROOT / "clients" / "python" / "README.md"], ids=["project", "package"]
)
def test_the_lines_of_a_readme_run_as_printed(file: Path, tmp_path: Path) -> None:
    """They call the address that a server has by default, which is not free on every machine: it is replaced."""
    (lines,) = re.findall(r"```python\n(import palpate\n.*?)```", file.read_text(), re.DOTALL)
    with palpate.local_server() as server:
        assert "http://127.0.0.1:7257" in lines
        lines = lines.replace("http://127.0.0.1:7257", server.url)
        run = subprocess.run([sys.executable, "-c", lines], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr
    assert file.name != "README.md" or file.parent != ROOT or re.search(r"mean error 0\.\d\d mm", run.stdout)
