"""Distances between a robot's shapes, and between these and obstacles."""

from nmm.collisions.obstacle import Obstacle as Obstacle
from nmm.collisions.shapes import Box as Box
from nmm.collisions.shapes import Capsule as Capsule
from nmm.collisions.shapes import ConvexMesh as ConvexMesh
from nmm.collisions.shapes import Cylinder as Cylinder
from nmm.collisions.shapes import HalfSpace as HalfSpace
from nmm.collisions.shapes import Hull as Hull
from nmm.collisions.shapes import Shape as Shape
from nmm.collisions.shapes import Sphere as Sphere
