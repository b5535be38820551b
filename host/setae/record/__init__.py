"""Logs: what happened in a run, in one MCAP file that other tools open too.

`Recorder` writes, `read` gives a `Log`. Messages are JSON, each topic has a JSON
schema, so Foxglove and the ``mcap`` command line tool read the files without
setae. Times are integer microseconds of the run's own clock: virtual time in
the simulator, so that the same run gives the same bytes.

==============  ==========  ===========================================================
topic           rate        what
==============  ==========  ===========================================================
/telemetry      50 Hz       board state and the four pulses, `Recorder.telemetry`
/pressure       75 Hz       samples of the bristle's sensor, `Recorder.pressure`
/trip           on event    a contact or deadline froze the pulses, `Recorder.trip`
/fault          on event    the board is in fault, `Recorder.fault`
/refusal        on event    the board refused a command, `Recorder.refusal`
/status         1 Hz        the board's supply, stop switch and counters, `Recorder.status`
/command        on event    what the program asked for, `Recorder.command`
/stage          on change   the arm that carries the robot, `Recorder.stage`
/experiment     on event    steps of an experiment, `Recorder.experiment`
/truth          25 Hz       the simulator's own state (simulated only), `Recorder.truth`
==============  ==========  ===========================================================

The metadata that reports look for, all optional: ``simulated`` (bool), ``seed``,
``config`` (TOML text), ``versions`` (name to version), ``experiment`` (its name),
``trial`` (its number, from 1), ``obstacle_below_tip_mm`` (or None), and ``scene``::

    {"tube": {"axis_mm": [x, y], "inner_radius_mm": r},
     "cube": {"centre_mm": [x, y, z], "edge_mm": e, "yaw_rad": a} or None,
     "arm_start_mm": [x, y, z]}

in the world frame (z up). Frame D hangs from the arm: x_D = x, y_D = -y, z_D = -z.

Events of the tube exploration on ``/experiment``: ``trial_start`` {obstacle},
``arm_lowering``, ``lowering_contact`` {contact}, ``level_start`` {descent_mm},
``direction_start`` {alpha_deg, target_mm}, ``direction_end`` {alpha_deg, touched,
contact}, ``level_end``, ``arm_return``, ``trial_end`` {descent_mm, contacts},
``trial_aborted`` {reason}. ``contact`` is None or a mapping with ``time_us``,
``tip_mm`` (the bristle's tip in frame D), ``tip_world_mm``, ``uncertainty_mm``,
``pressure_hpa``, ``baseline_hpa``.

Events of the scan of a surface: ``true_surface`` {step_mm, height_mm} (simulated only, at
time 0), ``scan_start`` {mode, order, step_mm, columns, rows, known, earlier_s}, ``step``
{target_mm, length_mm}, ``step_contact`` {position_mm, contact}, ``in_touch``, ``place``
{column, row, x_mm, y_mm, mark, height_mm, contact}, ``arm_return``, ``scan_end``
{duration_s}, ``scan_aborted`` {reason}. Metadata: ``mode``, ``part`` (from 1, where a scan
was resumed), and as scene {table_z_mm, object}.
"""

from __future__ import annotations

from setae.record.log import Damage, Event, Log
from setae.record.reading import read
from setae.record.recorder import FLUSH_US, Recorder
from setae.record.topics import TOPICS

__all__ = ["FLUSH_US", "TOPICS", "Damage", "Event", "Log", "Recorder", "read"]
