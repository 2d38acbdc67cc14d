"""Products with S = blkdiag(G, C) of a robot, q_dot = S u.

G (n_p, p) : the platform's velocity map; C : the identity, but for the row of each mimic joint
moved (arm inputs,) : the coordinate that each arm input moves
mimic_joints, who (4 k,) : each mimic joint's coordinate, leader, multiplier and offset (`Following.table`)
count : the number of platform inputs included: p, or 0 for the arm alone
"""

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import compiled


@compiled
def place_mimic_joints(q: Array, who: Array) -> None:
    """Set mimic joints in q (n,) from their leaders."""
    for i in range(0, who.shape[0], 4):
        q[int(who[i])] = who[i + 2] * q[int(who[i + 1])] + who[i + 3]


@compiled
def to_inputs(
    rows: Array, row: int, G: Array, count: int, moved: Array, mimic_joints: Array, out: Array
) -> None:
    """out (count + arm inputs,) = rows[row] S: a derivative by the coordinates becomes one by the inputs.
    Changes rows[row], as mimic joints' contributions are added to their leaders."""
    for i in range(0, mimic_joints.shape[0], 4):
        joint, leader = int(mimic_joints[i]), int(mimic_joints[i + 1])
        rows[row, leader] += mimic_joints[i + 2] * rows[row, joint]
    for j in range(count):
        out[j] = 0.0
        for i in range(G.shape[0]):
            out[j] += rows[row, i] * G[i, j]
    for j in range(moved.shape[0]):
        out[count + j] = rows[row, int(moved[j])]


@compiled
def to_coordinates(u: Array, G: Array, count: int, moved: Array, mimic_joints: Array, q_dot: Array) -> None:
    """q_dot (n,) = S u; coordinates that no input moves are not written."""
    for i in range(G.shape[0]):
        q_dot[i] = 0.0
        for j in range(count):
            q_dot[i] += G[i, j] * u[j]
    for j in range(moved.shape[0]):
        q_dot[int(moved[j])] = u[count + j]
    for i in range(0, mimic_joints.shape[0], 4):
        joint, leader = int(mimic_joints[i]), int(mimic_joints[i + 1])
        q_dot[joint] = mimic_joints[i + 2] * q_dot[leader]
