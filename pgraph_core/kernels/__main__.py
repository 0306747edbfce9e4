"""`python -m pgraph_core.kernels`: fill the disk cache, one line `i n name` a kernel."""

from . import warm_up


def main() -> None:
    """Compile every kernel, saying which."""
    for i, n, name in warm_up():
        print(i, n, name, flush=True)


if __name__ == "__main__":
    main()
