"""The viewer in a browser: controls, camera and pictures over viser, frames made by one thread for all browsers."""

from __future__ import annotations

import contextlib
import errno
import io
import math
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import viser
from PIL import Image

from .. import markdown
from ..errors import FlickerError
from ..front.ahead import common_up, target
from ..front.view import View
from ..params import LANE_COUNTS, RECOMMENDED, CatMode, Form, Precision, RenderConfig
from ..pipeline import Engine
from ..scene.camera import Camera
from .frames import OPACITY, SIMULATED, Choice, Frame, Renderer, camera_key, composed
from .keyframes import Keyframes
from .overlays import OVERLAYS
from .pace import Pace
from .pose import Pose, close, upright
from .simulate import Simulation
from .stills import save

ENGINES = {"golden": Engine.GOLDEN, "reference": Engine.REFERENCE, "RTL, last frame": Engine.RTL, "chip, last frame": Engine.CHIP}
PICTURE = "picture"  # instead of an overlay
QUALITY = {False: 75, True: 92}  # of JPEG: while moving, at rest
NUMBERS_AFTER = 0.6  # seconds of rest before numbers that take time are begun


def boxed(picture: Image.Image, aspect: float) -> tuple[Image.Image, tuple[int, int]]:
    """A picture in the middle of a black one of an aspect (width / height), and the place of its first pixel."""
    width, height = picture.size
    whole = (max(width, round(height * aspect)), max(height, round(width / aspect)))
    corner = ((whole[0] - width) // 2, (whole[1] - height) // 2)
    out = Image.new("RGB", whole)
    out.paste(picture, corner)
    return out, corner


def port_free(host: str, port: int) -> None:
    """FlickerError where nothing can listen there."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise FlickerError(f"--port: {port} is in use") from None
            raise FlickerError(f"--host {host}, --port {port}: {error.strerror or error}") from None
        except OverflowError as error:
            raise FlickerError(f"--port: {port}: {error}") from None


class Controls:
    """What one picture shows, as the browser sets it. changed: called after every change."""

    def __init__(self, gui: viser.GuiApi, title: str, changed: Callable[[], None]) -> None:
        words = lambda kind: [m.name.lower() for m in kind]  # noqa: E731
        default = RenderConfig()
        self.folder = gui.add_folder(title)
        with self.folder:
            self.engine = gui.add_dropdown("engine", list(ENGINES))
            self.stage = gui.add_dropdown("stage", ["lanes", "channels"], initial_value=RECOMMENDED.stage)
            self.lanes = gui.add_dropdown("lanes", [str(n) for n in LANE_COUNTS])
            self.mode = gui.add_dropdown("mode", words(CatMode), initial_value=default.cat.name.lower(), hint="contribution test")
            self.precision = gui.add_dropdown("precision", words(Precision), initial_value=default.precision.name.lower(), hint="of the contribution test")
            self.form = gui.add_dropdown("form", words(Form), initial_value=default.form.name.lower())
            self.overlay = gui.add_dropdown("overlay", [PICTURE, *OVERLAYS])

        def set_(_: Any) -> None:
            self.show()
            changed()

        for handle in (self.engine, self.stage, self.lanes, self.mode, self.precision, self.form, self.overlay):
            handle.on_update(set_)
        self.show()

    def show(self) -> None:
        """Only what the stage has."""
        self.lanes.visible = self.stage.value == "lanes"
        self.mode.visible = self.precision.visible = self.form.visible = self.stage.value == "channels"

    @property
    def choice(self) -> Choice:
        if self.stage.value == "lanes":
            config = RECOMMENDED.with_(lanes=int(self.lanes.value))
        else:
            config = RenderConfig(
                cat=CatMode[self.mode.value.upper()], precision=Precision[self.precision.value.upper()], form=Form[self.form.value.upper()],
            )
        return Choice(ENGINES[self.engine.value], config, None if self.overlay.value == PICTURE else self.overlay.value)


class Session:
    """One browser. Its callbacks say what is wanted; `step`, called by the viewer's thread, does it. sent: (time, divisor) of the pictures sent."""

    def __init__(self, viewer: Viewer, client: viser.ClientHandle) -> None:
        self.viewer, self.client, self.pace = viewer, client, Pace()
        self.camera = self.goal = viewer.start
        self.frames: list[Frame] = []
        self.repaint = False
        self.numbers: list[dict[str, str]] = []
        self.more: Iterator[None] | None = None
        self.more_at = 0.0
        self.tasks: list[Callable[[], None]] = []
        self.keyframes = Keyframes()
        self.corner, self.whole = (0, 0), viewer.size
        self.sent: list[tuple[float, int]] = []
        self._controls()
        client.camera.on_update(lambda _: self.moved())
        client.scene.on_click()(lambda event: self.clicked(event.screen_pos))
        self.ask(moving=False)

    def _controls(self) -> None:
        gui, viewer = self.client.gui, self.viewer
        self.a = Controls(gui, "picture", self.changed)
        self.comparing = gui.add_checkbox("compare", False, hint="a second configuration on the right")
        self.b = Controls(gui, "picture on the right", self.changed)
        self.b.folder.visible = False
        self.split = gui.add_slider("slider", 0.0, 1.0, 0.01, 0.5, visible=False)
        self.opacity = gui.add_slider("overlay's opacity", 0.0, 1.0, 0.05, OPACITY)
        self.status = gui.add_markdown("")
        self.table = gui.add_markdown("")
        self.picked = gui.add_markdown("*Click on the picture for the Gaussian there.*")
        with gui.add_folder("camera"):
            self.number = gui.add_number("view", viewer.number, min=0, max=len(viewer.cameras) - 1, step=1)
            go = gui.add_button("go to view")
            still = gui.add_button("save picture and camera")
            self.saved = gui.add_markdown("")
        with gui.add_folder("camera path", expand_by_default=False):
            self.seconds = gui.add_number("seconds from the last keyframe", 1.0, min=0.1, max=600.0, step=0.1)
            add = gui.add_button("add keyframe")
            remove = gui.add_button("remove last keyframe")
            keep = gui.add_button("save path")
            self.path_said = gui.add_markdown(str(self.keyframes))
        with gui.add_folder("simulate this view", expand_by_default=False):
            simulate = {engine: gui.add_button(name) for engine, name in SIMULATED.items()}
            stop = gui.add_button("stop")
            back = gui.add_button("go to the simulated view")
            self.progress = gui.add_markdown("")
        self.comparing.on_update(lambda _: self.compare())
        self.split.on_update(lambda _: self.changed(repaint=True))
        self.opacity.on_update(lambda _: self.changed(repaint=True))
        self.number.on_update(lambda _: self.go(viewer.cameras[int(self.number.value)]))
        go.on_click(lambda _: self.go(viewer.cameras[int(self.number.value)]))
        still.on_click(lambda _: self.later(self.save))
        add.on_click(lambda _: self.keyframe(self.keyframes.add, self.camera, float(self.seconds.value)))
        remove.on_click(lambda _: self.keyframe(self.keyframes.remove))
        keep.on_click(lambda _: self.save_path())
        for engine, button in simulate.items():
            button.on_click(partial(self.simulate, engine))
        stop.on_click(lambda _: viewer.stop_simulation())
        back.on_click(lambda _: self.go(viewer.shot or self.camera))

    # ---- what callbacks want

    @property
    def choices(self) -> tuple[Choice, ...]:
        return (self.a.choice, self.b.choice) if self.comparing.value else (self.a.choice,)

    def ask(self, moving: bool) -> None:
        with self.viewer.changed:
            self.pace.ask((camera_key(self.camera), self.choices, self.viewer.shots_made), time.monotonic(), moving)
            self.viewer.changed.notify()

    def changed(self, repaint: bool = False) -> None:
        if repaint:
            with self.viewer.changed:
                self.repaint = True
        self.ask(moving=False)

    def later(self, task: Callable[[], None]) -> None:
        """Call a task from the viewer's thread, when the full frame is there."""
        with self.viewer.changed:
            self.tasks.append(task)
            self.viewer.changed.notify()

    def compare(self) -> None:
        self.b.folder.visible = self.split.visible = self.comparing.value
        self.changed()

    def moved(self) -> None:
        """The browser's camera has moved, or its window has another shape."""
        at = self.client.camera
        camera = Pose(tuple(at.wxyz), tuple(at.position), float(at.fov)).camera(self.goal)
        if close(camera, self.goal):
            camera = self.goal
        if self._aspect() != self.whole[0] / self.whole[1]:
            with self.viewer.changed:
                self.repaint = True
        self.camera = camera
        self.ask(moving=True)

    def go(self, camera: Camera) -> None:
        """Look through a camera, at the size of the viewer."""
        self.goal = self.camera = camera.resized(*self.viewer.size)
        self.later(self._point)
        self.ask(moving=False)

    def _point(self) -> None:
        camera, at = self.goal, self.client.camera
        projected = self.viewer.renderer.view(camera).projected
        with self.client.atomic():
            at.fov = Pose.of(camera).fov
            at.position = camera.position
            at.look_at = target(camera, projected)
            at.up_direction = upright(camera, self.viewer.up)

    def keyframe(self, change: Callable[..., None], *of: Any) -> None:
        """Add or remove a keyframe, and say how many there are."""
        change(*of)
        self.path_said.content = str(self.keyframes)

    def save_path(self) -> None:
        try:
            path = self.keyframes.save(self.viewer.folder)
            self.path_said.content = f"{self.keyframes}, saved as {path}"
        except FlickerError as error:
            self.path_said.content = f"**{error}**"

    def simulate(self, engine: Engine, _: Any) -> None:
        self.viewer.simulate(engine, self.camera, self.a.choice.config)

    def clicked(self, place: tuple[float, float]) -> None:
        x, y = (int(p * n) - c for p, n, c in zip(place, self.whole, self.corner))
        width, height = self.viewer.size
        if 0 <= x < width and 0 <= y < height:
            self.picked.content = "*looking up the Gaussian...*"
            self.later(lambda: self.pick(x, y))

    # ---- what the viewer's thread does

    def step(self, now: float) -> float:
        """Do what is due next; seconds until more may be, 0: at once."""
        try:
            return self._step(now)
        except FlickerError as error:
            with self.viewer.changed:
                self.pace.made(self.pace.wanted, 1, 0.0, now)
            self.more, self.status.content = None, f"**{error}**"
            return 0.0

    def _step(self, now: float) -> float:
        with self.viewer.changed:
            divisor, wait = self.pace.due(now)
            wanted, camera, choices = self.pace.wanted, self.camera, self.choices
            repaint, self.repaint = self.repaint, False
        if divisor:
            self.status.content = "" if divisor > 1 else "*rendering...*"
            self.frames = [self.viewer.renderer.frame(camera, choice, divisor) for choice in choices]
            self.send(divisor)
            done = time.monotonic()
            with self.viewer.changed:
                self.pace.made(wanted, divisor, done - now, done)
            self.more = self.tell(self.frames) if divisor == 1 else None
            self.more_at = done + (NUMBERS_AFTER if self.pace.changed > -math.inf else 0.0)
            return 0.0
        if repaint:
            self.send(1)
            return 0.0
        with self.viewer.changed:
            task = self.tasks.pop(0) if self.tasks and self.pace.shown_divisor == 1 else None
        if task:
            task()
            return 0.0
        if self.more is None:
            return wait
        if now < self.more_at:
            return min(wait, self.more_at - now)
        if next(self.more, self) is self:
            self.more = None
        return 0.0

    def _aspect(self) -> float:
        at = self.client.camera
        return at.image_width / max(at.image_height, 1) or 1.0

    def picture(self) -> Image.Image:
        """What is shown, at the size of the viewer."""
        return composed(self.frames, self.viewer.size, self.split.value, self.opacity.value)

    def send(self, divisor: int) -> None:
        if self.frames:
            out, self.corner = boxed(self.picture(), self._aspect())
            self.whole = out.size
            self.client.scene.set_background_image(np.asarray(out), format="jpeg", jpeg_quality=QUALITY[divisor == 1])
            self.client.flush()
            self.sent.append((time.monotonic(), divisor))

    def tell(self, frames: Sequence[Frame]) -> Iterator[None]:
        """Write the numbers of frames, step by step."""
        numbers: list[dict[str, str]] = [{} for _ in frames]
        for k, frame in enumerate(frames):
            for found in self.viewer.renderer.numbers(frame):
                numbers[k] = found
                names = list(dict.fromkeys(name for column in numbers for name in column))
                rows = [[name, *(column.get(name, "") for column in numbers)] for name in names]
                heads = ["", "left", "right"] if len(frames) > 1 else ["", "picture"]
                self.table.content, self.status.content = markdown.table(heads, rows), "*counting...*"
                yield
        elsewhere = any(camera_key(frame.camera) != camera_key(self.camera) for frame in frames)
        self.status.content = "*a simulated frame, seen from where it was simulated*" if elsewhere else ""

    def pick(self, x: int, y: int) -> None:
        left = len(self.frames) < 2 or x < self.split.value * self.viewer.size[0]
        frame = self.frames[0 if left else 1]
        if (frame.camera.width, frame.camera.height) == self.viewer.size:
            self.picked.content = markdown.table(["under the pointer", ""], list(map(list, self.viewer.renderer.picked(frame, x, y).items())))

    def save(self) -> None:
        still, number = save(self.viewer.folder, self.picture(), self.frames[0].camera)
        self.saved.content = f"saved {still}, camera {number} of {self.viewer.folder / 'cameras.json'}"


class Viewer:
    """Serves a scene.

    view: where it begins, and the size of pictures. cameras: to go to. folder: where stills and cameras are saved. port: 0: any that is free.
    """

    def __init__(self, view: View, cameras: Sequence[Camera], folder: Path, host: str = "127.0.0.1", port: int = 8080) -> None:
        self.renderer, self.start, self.number = Renderer(view), view.camera, view.number
        self.cameras, self.folder = cameras, folder
        self.size = (view.camera.width, view.camera.height)
        self.up = common_up(cameras)
        self.changed = threading.Condition(threading.RLock())
        self.sessions: dict[int, Session] = {}
        self.shot: Camera | None = None
        self.shots_made = 0
        self._simulation: Simulation | None = None
        self._ended = False
        port_free(host, port)
        with contextlib.redirect_stdout(io.StringIO()):  # a banner, which comes before there is something to see
            self.server = viser.ViserServer(host, port, label=f"flicker view {view.name}", verbose=False)
        self.url = f"http://{host}:{self.server.get_port()}"
        self.server.gui.configure_theme(control_width="large", dark_mode=True, show_logo=False, show_share_button=False)
        self.server.gui.main_panel.dock_right()
        self.server.scene.set_up_direction(self.up)
        initial, projected = self.server.initial_camera, self.renderer.view(self.start).projected
        initial.position, initial.look_at, initial.up = self.start.position, target(self.start, projected), upright(self.start, self.up)
        initial.fov = Pose.of(self.start).fov
        self.server.on_client_connect(self._connected)
        self.server.on_client_disconnect(self._gone)

    def _connected(self, client: viser.ClientHandle) -> None:
        session = Session(self, client)
        with self.changed:
            self.sessions[client.client_id] = session
            self.changed.notify()

    def _gone(self, client: viser.ClientHandle) -> None:
        with self.changed:
            self.sessions.pop(client.client_id, None)

    def prepare(self) -> None:
        """Make the first frame, so that it is there when a browser is."""
        self.renderer.frame(self.start, Choice())

    def serve(self) -> None:
        """Make frames until `stop`."""
        while True:
            with self.changed:
                if self._ended:
                    return
                sessions = list(self.sessions.values())
            wait = min((session.step(time.monotonic()) for session in sessions), default=math.inf)
            with self.changed:
                if wait > 0.0 and not self._ended and not any(self._busy(s) for s in sessions) and sessions == list(self.sessions.values()):
                    self.changed.wait(None if wait == math.inf else wait)

    @staticmethod
    def _busy(session: Session) -> bool:
        """Something came while it worked."""
        return bool(session.repaint or session.pace.due(time.monotonic())[0] or session.tasks and session.pace.shown_divisor == 1)

    def stop(self) -> None:
        self.stop_simulation()
        with self.changed:
            self._ended = True
            self.changed.notify()
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()

    # ---- simulated frames

    def simulate(self, engine: Engine, camera: Camera, config: RenderConfig) -> None:
        """Simulate a frame, unless one is under way."""
        with self.changed:
            if self._simulation is None:
                self._tell("starting")
                self._simulation = Simulation(self.renderer.fresh(camera), engine, config, self._tell, self._done)

    def stop_simulation(self) -> None:
        with self.changed:
            if self._simulation is not None:
                self._simulation.stop()

    def _tell(self, text: str) -> None:
        for session in list(self.sessions.values()):
            session.progress.content = text

    def _done(self, result: Any) -> None:
        with self.changed:
            self._simulation = None
            if not isinstance(result, str):
                self.renderer.shots[result.engine] = result
                self.shot = result.camera
                self.shots_made += 1
        self._tell(result if isinstance(result, str) else f"{SIMULATED[result.engine]}: {result.stats['cycles']:,} cycles")
        for session in list(self.sessions.values()):
            session.ask(moving=False)
