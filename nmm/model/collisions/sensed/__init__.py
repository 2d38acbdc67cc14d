"""Obstacles as sensors see them: clouds of points, maps of occupied cells, heights of the ground."""

from nmm.model.collisions.sensed.occupancy_map import OccupancyMap as OccupancyMap
from nmm.model.collisions.sensed.point_cloud import PointCloud as PointCloud
from nmm.model.collisions.sensed.voxels import ElevationMap as ElevationMap
from nmm.model.collisions.sensed.voxels import VoxelMap as VoxelMap
