"""Records of a control step: the rows of tasks, and what a controller of second order computes with."""

from __future__ import annotations

from typing import NamedTuple

from nmm.base.kernels.record_layout import Cell, IntegerMatrix, IntegerVector, Matrix, Vector
from nmm.control.functions.program import Buffers


class TaskRows(NamedTuple):
    """The s rows of a stack of tasks.

    rows (s, 3) : the program's rows of f, g and e; for e, PLAIN or WRAPPED where no function computes it
    gain (s, s) : K
    speed, braking (s,) : ‖K e‖ <= speed, ‖K e‖² <= 2 braking ‖e‖ over the rows of a group
    group (s,) : the group of each row
    full (s,) : ∂g/∂t + K e without these bounds
    r, r_d, error (s,) : value, desired value and error, written by a step
    """

    rows: IntegerMatrix
    gain: Matrix
    speed: Vector
    braking: Vector
    group: IntegerVector
    full: Vector
    r: Vector
    r_d: Vector
    error: Vector


class SecondOrder(NamedTuple):
    """Of m inputs and c rows: the task's, the added task's, those of limits. At first order all are empty.

    servo () : k, 1/s
    h () : step of the differences, s
    share () : k dt with limits, else 1: the share of the way to the resolver's answer that a sample goes
    stages : how many of the program's stages compute rows that are differenced
    buffers, task, added : these rows, beside q
    beside (n,) : the configuration there
    y (3, c) : rate - J u behind, here and ahead; of a limit, its rate
    D (c,) : their derivatives along the motion
    lead (s,) : by how much the task's rate is led
    lower, upper (m,) : bounds of the inputs at the end of the sample
    u_dot (m,) : the answer
    """

    servo: Cell
    h: Cell
    share: Cell
    stages: int
    buffers: Buffers
    task: TaskRows
    added: TaskRows
    beside: Vector
    y: Matrix
    D: Vector
    lead: Vector
    lower: Vector
    upper: Vector
    u_dot: Vector
