"""What can happen. The page's own events are validated by their annotations (`from_page`)."""

from __future__ import annotations

import json

from pydantic import TypeAdapter

from ..state import SHOWABLE
from . import constraining as constraining
from . import describing as describing
from .analysing import (
    Analyse as Analyse,
)
from .analysing import (
    CancelAnalysis as CancelAnalysis,
)
from .analysing import (
    DownloadReport as DownloadReport,
)
from .analysing import (
    Measured as Measured,
)
from .analysing import (
    Measuring as Measuring,
)
from .analysing import (
    NotMeasured as NotMeasured,
)
from .analysing import (
    SetReport as SetReport,
)
from .base import FromPage as FromPage
from .editing import (
    Edit as Edit,
)
from .editing import (
    NewModel as NewModel,
)
from .editing import (
    OpenArchive as OpenArchive,
)
from .editing import (
    OpenBuiltIn as OpenBuiltIn,
)
from .editing import (
    OpenKept as OpenKept,
)
from .editing import (
    OpenText as OpenText,
)
from .editing import (
    Redo as Redo,
)
from .editing import (
    Undo as Undo,
)
from .graph import (
    Drop as Drop,
)
from .graph import (
    StepThrough as StepThrough,
)
from .looking import (
    ExportOperator as ExportOperator,
)
from .looking import (
    Inspect as Inspect,
)
from .looking import (
    Unreadable as Unreadable,
)
from .playing import (
    Loop as Loop,
)
from .playing import (
    Pause as Pause,
)
from .playing import (
    Play as Play,
)
from .playing import (
    Scrub as Scrub,
)
from .playing import (
    Speed as Speed,
)
from .playing import (
    StepFrames as StepFrames,
)
from .playing import (
    Tick as Tick,
)
from .plotting import (
    Plot as Plot,
)
from .posing import (
    Gizmo as Gizmo,
)
from .posing import (
    Grip as Grip,
)
from .posing import (
    HomePose as HomePose,
)
from .posing import (
    Pose as Pose,
)
from .posing import (
    Posing as Posing,
)
from .posing import (
    Pull as Pull,
)
from .posing import (
    UsePose as UsePose,
)
from .running import (
    Advanced as Advanced,
)
from .running import (
    Cancel as Cancel,
)
from .running import (
    Compare as Compare,
)
from .running import (
    Compiled as Compiled,
)
from .running import (
    Compiling as Compiling,
)
from .running import (
    Continue as Continue,
)
from .running import (
    Export as Export,
)
from .running import (
    Failed as Failed,
)
from .running import (
    GoLive as GoLive,
)
from .running import (
    Progress as Progress,
)
from .running import (
    SetRun as SetRun,
)
from .running import (
    SetScenario as SetScenario,
)
from .running import (
    Simulate as Simulate,
)
from .running import (
    Simulated as Simulated,
)
from .running import (
    StopLive as StopLive,
)
from .running import (
    Stuck as Stuck,
)
from .session import (
    Connected as Connected,
)
from .session import (
    Disconnected as Disconnected,
)
from .session import (
    Download as Download,
)
from .session import (
    Hello as Hello,
)
from .session import (
    Misread as Misread,
)
from .session import (
    NotKept as NotKept,
)
from .session import (
    Save as Save,
)
from .session import (
    Saved as Saved,
)
from .session import (
    Select as Select,
)
from .session import (
    SelectBodies as SelectBodies,
)
from .session import (
    Show as Show,
)
from .session import (
    Theme as Theme,
)
from .session import (
    Viewport as Viewport,
)
from .table import (
    AddBody as AddBody,
)
from .table import (
    CountBodies as CountBodies,
)
from .table import (
    DeleteBodies as DeleteBodies,
)
from .table import (
    Duplicate as Duplicate,
)
from .table import (
    MirrorBranch as MirrorBranch,
)
from .table import (
    MoveRows as MoveRows,
)
from .table import (
    Paste as Paste,
)
from .table import (
    SetParent as SetParent,
)
from .walking import (
    Push as Push,
)
from .walking import (
    SetGait as SetGait,
)
from .walking import (
    SetGround as SetGround,
)
from .walking import (
    SetWalk as SetWalk,
)
from .walking import (
    Walk as Walk,
)

Event = (
    FromPage
    | Measuring
    | Measured
    | NotMeasured
    | Tick
    | Progress
    | Simulated
    | Failed
    | Advanced
    | Stuck
    | Compiling
    | Compiled
    | Saved
    | NotKept
    | Unreadable
    | constraining.MobilityFound
    | constraining.ErrandDone
)
OF_THE_SERVER = (Connected, Disconnected, Misread)

PAGE_EVENTS = {
    kind.__name__: TypeAdapter(kind)
    for kind in FromPage.__subclasses__()
    if kind not in OF_THE_SERVER
}


def from_page(client: int, text: str) -> FromPage:
    """The event in a page's message `{"event": name, ...fields}`; Misread if there is none."""
    try:
        fields = json.loads(text)
        adapter = PAGE_EVENTS[fields.pop("event")]
        fields["client"] = client
        event = adapter.validate_json(json.dumps(fields), strict=True)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as problem:
        return Misread(client, f"{type(problem).__name__}: {problem}"[:300])
    if isinstance(event, Show) and event.what not in SHOWABLE:
        return Misread(client, f"nothing is called {event.what!r}")
    return event
