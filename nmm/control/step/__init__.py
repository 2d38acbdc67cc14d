"""One step of a controller: equation, preparation, resolution, and the record of what it keeps."""
