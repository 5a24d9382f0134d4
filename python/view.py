#!/usr/bin/env python3
"""Opens recordings in Rerun, arranged: the arm on the left, force, gains and reward on the right.

    pip install rerun-sdk
    python3 python/view.py runs/RUN/episodes/*.mcap
    python3 python/view.py EPISODE.mcap --save EPISODE.rrd     # arranged, to be opened later

A bare `rerun EPISODE.mcap` shows the same data; only the plots have to be put together by hand.
"""

import argparse
import pathlib

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

AXES = ["x", "y", "z"]
COLOURS = [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [230, 159, 0], [86, 180, 233]]


def lines(message, fields):
    """One line for each field of a protobuf message."""
    return [
        rr.SeriesLines(names=field.replace("_", " "), colors=COLOURS[i % len(COLOURS)], widths=2.0).visualizer(
            mappings=[
                VisualizerComponentMapping(
                    target="Scalars:scalars",
                    source_kind=ComponentSourceKind.SourceComponent,
                    source_component=f"{message}:message",
                    selector=f".{field}",
                )
            ]
        )
        for i, field in enumerate(fields)
    ]


def plot(name, entity, message, fields):
    return rrb.TimeSeriesView(
        name=name, origin=entity, contents="$origin", overrides={entity: lines(message, fields)}
    )


def arrangement():
    eye = rrb.EyeControls3D(position=[0.75, -0.45, 0.55], look_target=[0.24, 0.08, 0.17], eye_up=[0.0, 0.0, 1.0])
    arm = rrb.Spatial3DView(
        name="arm",
        origin="/",
        contents=["/**", "- /tool/**", "- /frames/**"],
        spatial_information=rrb.SpatialInformation(target_frame="base_link"),
        eye_controls=eye,
    )
    gains = [f"{gain}_z" for gain in ("position", "selection")]
    plots = rrb.Vertical(
        plot("contact force, N", "/wrench", "palpate.Wrench", ["force_x", "force_y", "force_z", "force", "force_limit"]),
        plot("error to the believed goal, m", "/error", "palpate.PoseError", AXES),
        plot("gains along z", "/gains", "palpate.Gains", gains),
        plot("reward terms", "/reward", "palpate.Reward", ["distance", "action", "force"]),
        rrb.TextLogView(name="what happened", origin="/log"),
        row_shares=[3, 2, 2, 2, 1],
    )
    return rrb.Blueprint(
        rrb.Horizontal(arm, plots, column_shares=[3, 2]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="message_log_time"),
        auto_views=False,
        auto_layout=False,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=pathlib.Path)
    parser.add_argument("--save", type=pathlib.Path, help="write an .rrd file instead of opening a window")
    args = parser.parse_args()
    for i, path in enumerate(args.recordings):
        recording = rr.RecordingStream("palpate", recording_id=path.stem)
        if args.save:
            recording.save(args.save)
        elif i == 0:
            recording.spawn()
        else:
            recording.connect_grpc()
        recording.send_recording_name(path.stem)
        recording.send_blueprint(arrangement())
        recording.log_file_from_path(path)
        recording.flush()


if __name__ == "__main__":
    main()
