"""Progress bars from tqdm, for `progress=True`."""

from __future__ import annotations

import contextlib
import inspect
import warnings
from collections.abc import Callable, Iterator
from typing import Any

from ..errors import InputError, Problem, needed, shown

Progress = Callable[[float], Any] | None


@contextlib.contextmanager
def shown_progress(given: Any, where: str) -> Iterator[Progress]:
    """Yield a progress function: the given one, a progress bar for True, or None for False.

    `where` names the calling function. Raises InputError for other arguments.
    """
    if given is None or given is False:
        yield None
    elif given is True:
        with warnings.catch_warnings(action="ignore"):  # a notebook without widgets has text bars
            tqdm = needed("tqdm.auto", "notebook").tqdm
        form = "{l_bar}{bar}| {elapsed}<{remaining}"
        with tqdm(total=1.0, desc=where, bar_format=form) as bar:

            def tell(fraction: float) -> None:
                bar.update(max(fraction - bar.n, 0.0))

            yield tell
            tell(1.0)
    elif callable(given):
        with contextlib.suppress(ValueError):  # a function of C may have no signature
            try:
                inspect.signature(given).bind(0.5)
            except TypeError:
                text = "must take one argument, the completed fraction, got a function that"
                text = f"{text} takes {inspect.signature(given)}"
                raise InputError(Problem(where, "progress", text)) from None
        yield given
    else:
        text = f"must be a function of the completed fraction, got {shown(given)}"
        raise InputError(Problem(where, "progress", text))
