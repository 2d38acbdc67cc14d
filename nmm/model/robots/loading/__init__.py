"""Loading robots: from a bundled name, a URDF or xacro file, or a Pinocchio model."""

from nmm.model.robots.loading.load import load as load
from nmm.model.robots.loading.mount import mount as mount
from nmm.model.robots.loading.pinocchio_layout import PinocchioLayout as PinocchioLayout
from nmm.model.robots.loading.pinocchio_layout import pinocchio_model as pinocchio_model
from nmm.model.robots.loading.pinocchio_layout import pinocchio_models as pinocchio_models
