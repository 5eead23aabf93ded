"""Print the lower bounds in pyproject.toml as exact pins, for pip."""

import tomllib
from pathlib import Path

project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
wanted = [*project["dependencies"], *project["optional-dependencies"]["test"]]
print(*(requirement.replace(">=", "==") for requirement in wanted))
