"""The layout of the page, and all views on it."""

from __future__ import annotations

from collections.abc import Callable

import viser

from .constraints.view import ConstraintsView
from .core.bridge import Bridge
from .core.events import Event
from .digraph.view import DigraphView
from .gait.view import FootprintsView, GaitView, PhasesView
from .model.view import ToolbarView
from .operators.view import OperatorsView
from .playback.view import PlaybackView
from .plots.view import PlotsView
from .pose.view import JointsView
from .properties.view import PropertiesView
from .report.view import ReportsView
from .run.view import ExportView, RunView
from .scene.view import FollowView, GhostView, SceneView, ShowView
from .session.update import Connected, Disconnected
from .session.view import ACCENT, SessionView
from .table.view import TableView

LEFT, RIGHT = 450, 330  # widths of the docks [px]
PLAYBACK = 470  # width [px] of the playback; its style widens it where there is room


class Page:
    """Docks left and right of the 3D view, playback floating at its bottom."""

    def __init__(self, bridge: Bridge, send: Callable[[Event], None]):
        server = bridge.server
        gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=ACCENT)
        bodies, graph, properties, playback = (gui.add_panel() for _ in range(4))
        with bodies.add_tab("Bodies", viser.Icon.TABLE):
            table = TableView(bridge)
        with graph.add_tab("Digraph", viser.Icon.SITEMAP):
            digraph = DigraphView(bridge)
        with graph.add_tab("Constraints", viser.Icon.LINK):
            ties = ConstraintsView(bridge)
        with graph.add_tab("Operators", viser.Icon.GRID_DOTS):
            operators = OperatorsView(bridge)
        with graph.add_tab("Plots", viser.Icon.CHART_LINE):
            plots = PlotsView(bridge)
        with graph.add_tab("Report", viser.Icon.REPORT_ANALYTICS):
            reports = ReportsView(bridge)
        toolbar, run = ToolbarView(bridge), RunView(bridge)  # viser's panel
        with properties.add_tab("Properties", viser.Icon.ADJUSTMENTS):
            details = PropertiesView(bridge)
        with properties.add_tab("Pose", viser.Icon.ADJUSTMENTS_HORIZONTAL):
            joints = JointsView(bridge)
        with properties.add_tab("Show", viser.Icon.EYE):
            show = ShowView(bridge)
        walk = GaitView(bridge, properties)
        with playback.add_tab("Playback", viser.Icon.PLAYER_PLAY):
            player, feet = PlaybackView(bridge), PhasesView(bridge)
        bodies.dock_left()
        bodies.set_width(LEFT)
        graph.dock_below(bodies)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(RIGHT)
        properties.dock_below(gui.main_panel)
        playback.float(x=15, y=-15, width=PLAYBACK)
        self.views = (
            table, digraph, ties, operators, toolbar, run, show, details, joints, player, plots,
            reports, walk, feet, SceneView(server, send), GhostView(server),
            FootprintsView(server), FollowView(server), ExportView(bridge), SessionView(bridge),
        )  # fmt: skip

        @server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            bridge.connect(client)
            send(Connected(client.client_id))

        @server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            send(Disconnected(client.client_id))
