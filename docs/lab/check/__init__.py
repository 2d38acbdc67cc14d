"""The checks of the lab's exercises: `check.jacobian(J)` says in words whether J is right, or what is not.

They judge by laws (J u = rate, differences, what a constant velocity must give), in the first two labs also
against nmm's own answers, at random configurations. None tells the solution. An answer that is not written
yet is "not yet", never an error.
"""

from check.lab_1 import (
    all_coordinates as all_coordinates,
)
from check.lab_1 import (
    far_from_the_axle as far_from_the_axle,
)
from check.lab_1 import (
    gradient as gradient,
)
from check.lab_1 import (
    hand as hand,
)
from check.lab_1 import (
    jacobian as jacobian,
)
from check.lab_1 import (
    platform as platform,
)
from check.lab_1 import (
    projected_gradient as projected_gradient,
)
from check.lab_1 import (
    reduced_gradient as reduced_gradient,
)
from check.lab_1 import (
    redundancy as redundancy,
)
from check.lab_1 import (
    singular_block as singular_block,
)
from check.lab_2 import (
    closed_loop as closed_loop,
)
from check.lab_2 import (
    design as design,
)
from check.lab_2 import (
    drive as drive,
)
from check.lab_2 import (
    effort as effort,
)
from check.lab_2 import (
    euler as euler,
)
from check.lab_2 import (
    fitted_gain as fitted_gain,
)
from check.lab_2 import (
    peaks as peaks,
)
from check.lab_2 import (
    share_left as share_left,
)
from check.lab_2 import (
    task_rate as task_rate,
)
from check.lab_3 import (
    algorithmic_singularity as algorithmic_singularity,
)
from check.lab_3 import (
    ellipsoid as ellipsoid,
)
from check.lab_3 import (
    extended_jacobian as extended_jacobian,
)
from check.lab_3 import (
    joint_column as joint_column,
)
from check.lab_3 import (
    priorities as priorities,
)
from check.lab_3 import (
    rotation_vector as rotation_vector,
)
from check.lab_3 import (
    spatial_jacobian as spatial_jacobian,
)
from check.lab_3 import (
    speed_along as speed_along,
)
from check.lab_3 import (
    target_jacobian as target_jacobian,
)
from check.verdicts import ready as ready
from check.verdicts import score as score
