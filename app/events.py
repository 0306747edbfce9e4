"""What can happen. The page's own events are validated by their annotations (`from_page`)."""

from __future__ import annotations

import json

from pydantic import TypeAdapter

from .constraints import events as constraining
from .core.event import FromPage as FromPage
from .core.state import SHOWABLE
from .digraph.events import Drop as Drop
from .digraph.events import StepThrough as StepThrough
from .gait.events import Push as Push
from .gait.events import SetGait as SetGait
from .gait.events import SetGround as SetGround
from .gait.events import SetWalk as SetWalk
from .gait.events import Walk as Walk
from .model.events import Edit as Edit
from .model.events import NewModel as NewModel
from .model.events import OpenArchive as OpenArchive
from .model.events import OpenBuiltIn as OpenBuiltIn
from .model.events import OpenKept as OpenKept
from .model.events import OpenText as OpenText
from .model.events import Redo as Redo
from .model.events import Undo as Undo
from .operators.events import ExportOperator as ExportOperator
from .operators.events import Inspect as Inspect
from .operators.events import Unreadable as Unreadable
from .playback.events import Loop as Loop
from .playback.events import Pause as Pause
from .playback.events import Play as Play
from .playback.events import Scrub as Scrub
from .playback.events import Speed as Speed
from .playback.events import StepFrames as StepFrames
from .playback.events import Tick as Tick
from .plots.events import Plot as Plot
from .pose.events import Gizmo as Gizmo
from .pose.events import Grip as Grip
from .pose.events import HomePose as HomePose
from .pose.events import Pose as Pose
from .pose.events import Posing as Posing
from .pose.events import Pull as Pull
from .pose.events import UsePose as UsePose
from .report.events import Analyse as Analyse
from .report.events import CancelAnalysis as CancelAnalysis
from .report.events import DownloadReport as DownloadReport
from .report.events import Measured as Measured
from .report.events import Measuring as Measuring
from .report.events import NotMeasured as NotMeasured
from .report.events import SetReport as SetReport
from .run.events import Advanced as Advanced
from .run.events import Cancel as Cancel
from .run.events import Compare as Compare
from .run.events import Compiled as Compiled
from .run.events import Compiling as Compiling
from .run.events import Continue as Continue
from .run.events import Export as Export
from .run.events import Failed as Failed
from .run.events import GoLive as GoLive
from .run.events import Progress as Progress
from .run.events import SetRun as SetRun
from .run.events import SetScenario as SetScenario
from .run.events import Simulate as Simulate
from .run.events import Simulated as Simulated
from .run.events import StopLive as StopLive
from .run.events import Stuck as Stuck
from .session.events import Connected as Connected
from .session.events import Disconnected as Disconnected
from .session.events import Download as Download
from .session.events import Hello as Hello
from .session.events import Misread as Misread
from .session.events import NotKept as NotKept
from .session.events import Save as Save
from .session.events import Saved as Saved
from .session.events import Select as Select
from .session.events import SelectBodies as SelectBodies
from .session.events import Show as Show
from .session.events import Theme as Theme
from .session.events import Viewport as Viewport
from .table.events import AddBody as AddBody
from .table.events import CountBodies as CountBodies
from .table.events import DeleteBodies as DeleteBodies
from .table.events import Duplicate as Duplicate
from .table.events import MirrorBranch as MirrorBranch
from .table.events import MoveRows as MoveRows
from .table.events import Paste as Paste
from .table.events import SetParent as SetParent

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
