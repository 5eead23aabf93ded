"""The wheel holds what the tree holds: a sub-package that is not listed works when editable and is
missing from the wheel."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: Where each package's files lie in the tree.
PLACES = {
    "compiler/drillc": "drillc",
    "grammars": "drillc/grammars",
    "templates": "drillc/templates",
    "postprocessors": "drillc/postprocessors",
}


def in_tree() -> set[str]:
    tracked = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", *PLACES],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout.split()
    found = set()
    for path in tracked:
        place = next(p for p in PLACES if path.startswith(p + "/"))
        if (ROOT / path).exists():
            found.add(PLACES[place] + path.removeprefix(place))
    return found


def test_the_wheel_holds_the_tree_and_nothing_else(tmp_path: Path) -> None:
    # A copy, so that what an earlier build left in the tree cannot get into the wheel.
    source = tmp_path / "source"
    for place in PLACES:
        shutil.copytree(ROOT / place, source / place, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source / name)
    subprocess.run(
        [
            *(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"),
            *("--no-build-isolation", "--wheel-dir", str(tmp_path), str(source)),
        ],
        check=True,
        capture_output=True,
    )
    (wheel,) = tmp_path.glob("drillc-*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    packaged = {name for name in names if ".dist-info/" not in name}
    assert packaged == in_tree()
    assert any(name.endswith("licenses/LICENSE") for name in names)
