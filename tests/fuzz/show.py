"""Write the files of one fuzz case down: `python tests/fuzz/show.py SEED FOLDER`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from fuzz.judging import lay_out
from fuzz.mutations import case_of

if __name__ == "__main__":
    seed, folder = sys.argv[1:]
    case = case_of(int(seed))
    lay_out(case.tree, Path(folder))
    print(case)
