"""What sightings of an arm say of it: joint zeros, placements of its joints, where cameras and markers
sit."""
