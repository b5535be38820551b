"""Reports: what a run's logs say, as a web page, pictures and tables.

`write` is the way in. The modules: `trial` reads a log, `shapes` and `drawing`
draw the robot, `pictures`, `html` and `tables` write the files, `paper` holds
the paper's numbers. Matplotlib and Plotly come with the extra ``report`` and are
imported when first needed.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from setae.record import Log
from setae.report import explore

__all__ = ["explore", "write"]


def write(logs: str | Path | Iterable[str | Path | Log], path: str | Path) -> Path:
    """Write the report of an exploration; `explore.write` with the page's own path.

    Parameters
    ----------
    logs
        A folder with logs, one log, or several; each log holds one trial.
    path
        The page to write, such as ``runs/explore-1/report.html``. Pictures and
        tables go into the same folder.

    Returns
    -------
    Path
        The page.
    """
    path = Path(path)
    return explore.write(logs, path.parent, page=path.name).page
