"""What sensors leave, as a shape: points and boxes by cells, distances to them, and how they are drawn."""

from nmm.model.collisions.elements.boxes import Elements as Elements
