"""Maps of singular values and manipulability, over two coordinates or a plane of the workspace."""
