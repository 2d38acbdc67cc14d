"""Distances between a robot's shapes, and between these and obstacles."""

from nmm.model.collisions.obstacle import Obstacle as Obstacle
from nmm.model.collisions.sensed import ElevationMap as ElevationMap
from nmm.model.collisions.sensed import OccupancyMap as OccupancyMap
from nmm.model.collisions.sensed import PointCloud as PointCloud
from nmm.model.collisions.sensed import VoxelMap as VoxelMap
from nmm.model.collisions.shapes import Box as Box
from nmm.model.collisions.shapes import Capsule as Capsule
from nmm.model.collisions.shapes import ConvexMesh as ConvexMesh
from nmm.model.collisions.shapes import Cylinder as Cylinder
from nmm.model.collisions.shapes import HalfSpace as HalfSpace
from nmm.model.collisions.shapes import Hull as Hull
from nmm.model.collisions.shapes import Shape as Shape
from nmm.model.collisions.shapes import Sphere as Sphere
