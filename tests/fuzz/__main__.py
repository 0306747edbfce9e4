"""Judge random scenes: `python -m tests.fuzz --scenes 2000 --seed 5 --first 0`.

Prints each run that is wrong without a notice as it is found, then the sums by family.
"""

import time
from argparse import ArgumentParser

from .judge import Find, hunt, line, told

parser = ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
parser.add_argument("--scenes", type=int, default=2000)
parser.add_argument("--seed", type=int, default=0)
parser.add_argument("--first", type=int, default=0, help="number of the first scene")
args = parser.parse_args()
began, finds = time.perf_counter(), list[Find]()
for find in hunt(args.scenes, args.seed, first=args.first):
    finds.append(find)
    if find.verdict == "silent":
        print(line(find), flush=True)
print(told(finds, time.perf_counter() - began))
