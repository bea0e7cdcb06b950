"""A recording for the Rerun viewer: a robot that moves, its ghost, the floor, and the curves of every joint."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import to_rgb
from scipy.spatial.transform import Rotation

from gsl.core.body import MESH, Robot, Shape, lump
from gsl.core.dynamics import forward_kinematics
from gsl.core.trajectory import Trajectory
from gsl.errors import InputError, shorten
from gsl.report.film import Shot
from gsl.report.film_strip import places, turns, walks
from gsl.report.shown import scale_of
from gsl.robots.meshes import Part, draw_parts

if TYPE_CHECKING:
    import rerun

PARTS = ("robot", "ghost")
CLEAR = 0.35  # opacity of the ghost
ROOM = 0.2  # of floor around a base [m], a foot's length: the more floor, the smaller the robot in the window
ABREAST = 3  # curves in a row beside the robot: names of joints can be read on a usual screen
_ALONG = {"x": Rotation.from_euler("y", 90, degrees=True), "y": Rotation.from_euler("x", -90, degrees=True)}
_UPRIGHT = Rotation.identity()


def check_viewer() -> None:
    """Refuse before anything is simulated.

    Raises:
        InputError: The library is missing.
    """
    try:
        import rerun  # noqa: F401
    except ImportError as error:
        advice = "pip install 'gsl[rerun]', or gsl render, which writes a film"
        raise InputError(f"the viewer needs gsl[rerun]: {advice} ({error})") from error


def record_shots(robot: Robot, joints: Sequence[str], shots: Sequence[Shot], path: Path | None) -> None:
    """Write a recording of one or two trajectories, the second as a ghost; without a path, show it in the viewer.

    Raises:
        InputError: The viewer cannot be started.
    """
    import rerun

    recording = rerun.RecordingStream("gsl")  # with an id of its own: a window may show several of the same log
    if path is not None:
        recording.save(str(path))
    else:
        try:
            recording.spawn()
        except (RuntimeError, OSError) as error:
            why = shorten(" ".join(str(error).split()))
            raise InputError(f"write a file with out=motion.rrd; the viewer cannot be started: {why}") from error
    recording.send_recording_name(" and ".join(shot.title for shot in shots))
    _arrange(recording, joints, robot.slides)
    recording.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _log_floor(recording, shots)
    for part, shot in zip(PARTS, shots, strict=False):
        _log_body(recording, robot, part, shot)
        _log_motion(recording, robot, joints, part, shot.trajectory)
        _log_curves(recording, joints, part, shot, robot.slides)
    recording.flush()
    recording.disconnect()


def _arrange(recording: rerun.RecordingStream, joints: Sequence[str], slides: Sequence[str]) -> None:
    """Lay the window out: the robot, and a plot of each joint beside it; the viewer's own guess shows no plot."""
    from rerun import blueprint

    curves = [
        blueprint.TimeSeriesView(
            origin=f"/joints/{joint}",
            name=f"{joint} [{scale_of(joint, slides).unit}]",
            plot_legend=blueprint.PlotLegend(visible=joint == joints[0]),  # it covers curves, and all have the same
        )
        for joint in joints
    ]
    plots = blueprint.Grid(*curves, grid_columns=ABREAST)
    robot = blueprint.Spatial3DView(origin="/world", name="robot")
    panels = (blueprint.BlueprintPanel(state="collapsed"), blueprint.SelectionPanel(state="collapsed"))
    recording.send_blueprint(blueprint.Blueprint(blueprint.Horizontal(robot, plots), *panels))


def _log_floor(recording: rerun.RecordingStream, shots: Sequence[Shot]) -> None:
    """Log lines on the floor, a metre apart, as far as anybody goes; for a base that is held there is none."""
    import rerun

    if not any(walks(shot.trajectory) for shot in shots):
        return
    way = np.concatenate([places(shot.trajectory)[:, :2] for shot in shots])
    (left, low), (right, high) = np.floor(way.min(axis=0) - ROOM), np.ceil(way.max(axis=0) + ROOM)
    lines = [[[x, low, 0.0], [x, high, 0.0]] for x in np.arange(left, right + 0.5)]
    lines += [[[left, y, 0.0], [right, y, 0.0]] for y in np.arange(low, high + 0.5)]
    recording.log("world/floor", rerun.LineStrips3D(np.array(lines), colors=[150, 150, 150]), static=True)


def _log_body(recording: rerun.RecordingStream, robot: Robot, part: str, shot: Shot) -> None:
    """Log the shapes of the links once; they hang on frames that move."""
    import rerun

    ghost = part == PARTS[1]
    for name, link in lump(robot).links.items():
        for number, (solid, shape_colour) in enumerate(_solids(rerun, link.looks)):
            colour = [*(to_rgb(shot.colour) if ghost else shape_colour), CLEAR if ghost else 1.0]
            recording.log(f"world/{part}/{name}/shape_{number}", solid(colour), static=True)
    recording.log(f"world/{part}", rerun.AnyValues(title=shot.title), static=True)


def _solids(rerun: Any, shapes: Sequence[Shape]) -> Iterator[tuple[Callable[[Sequence[float]], Any], Sequence[float]]]:
    """Yield what makes a solid of a colour, and the colour that it has of its own; of a mesh for each of its parts."""
    for shape in shapes:
        if shape.kind != MESH:
            yield partial(_solid, rerun, shape), shape.colour
        for mesh in draw_parts(shape) if shape.kind == MESH else ():
            yield partial(_mesh, rerun, mesh), mesh.colour or shape.colour


def _mesh(rerun: Any, part: Part, colour: Sequence[float]) -> Any:
    shade = [round(255 * value) for value in colour]
    return rerun.Mesh3D(vertex_positions=part.vertices, triangle_indices=part.faces, albedo_factor=shade)


def _solid(rerun: Any, shape: Shape, colour: Sequence[float]) -> Any:
    turn = Rotation.from_euler("xyz", shape.turn)
    along = _ALONG.get(shape.along, _UPRIGHT) if shape.kind == "cylinder" else _UPRIGHT
    how = {
        "centers": [shape.centre],
        "quaternions": [rerun.Quaternion(xyzw=(turn * along).as_quat())],
        "colors": [[round(255 * value) for value in colour]],
        "fill_mode": rerun.components.FillMode.Solid,
    }
    if shape.kind == "box":
        return rerun.Boxes3D(sizes=[shape.size], **how)
    if shape.kind == "sphere":
        return rerun.Ellipsoids3D(half_sizes=[[shape.size[0]] * 3], **how)
    return rerun.Cylinders3D(radii=[shape.size[0]], lengths=[shape.size[1]], **how)


def _log_motion(
    recording: rerun.RecordingStream, robot: Robot, joints: Sequence[str], part: str, trajectory: Trajectory
) -> None:
    import rerun

    body = lump(robot)
    columns = dict(zip(joints, trajectory.position.T, strict=True))
    columns |= {name: columns[driver] for name, driver in robot.coupled.items() if driver in columns}
    poses = [
        forward_kinematics(body, {**robot.stance, **{name: float(values[t]) for name, values in columns.items()}})
        for t in range(len(trajectory.time))
    ]
    where, base = places(trajectory), Rotation.from_quat(turns(trajectory))
    time = rerun.TimeColumn("time", duration=trajectory.time)
    for name in body.links:
        origin = where + base.apply(np.array([pose.origin[name] for pose in poses]))
        turn = base * Rotation.from_matrix(np.array([pose.turn[name] for pose in poses]))
        frames = rerun.Transform3D.columns(translation=origin, quaternion=turn.as_quat())
        recording.send_columns(f"world/{part}/{name}", [time], frames)


def _log_curves(
    recording: rerun.RecordingStream, joints: Sequence[str], part: str, shot: Shot, slides: Sequence[str]
) -> None:
    import rerun

    colour = [round(255 * value) for value in to_rgb(shot.colour)]
    trajectory = shot.trajectory
    curves = {part: (trajectory.position, colour, 2.0)}
    if part == PARTS[0]:
        curves["command"] = (trajectory.action, [120, 120, 120], 1.0)
    for name, (values, shade, width) in curves.items():
        time = rerun.TimeColumn("time", duration=trajectory.time[: len(values)])
        for k, joint in enumerate(joints):
            place, scale = f"joints/{joint}/{name}", scale_of(joint, slides)
            recording.log(place, rerun.SeriesLines(colors=[shade], widths=[width], names=name), static=True)
            recording.send_columns(place, [time], rerun.Scalars.columns(scalars=scale.factor * values[:, k]))
