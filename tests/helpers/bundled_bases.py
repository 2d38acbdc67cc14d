"""The bundled bases, each with what it is loaded as."""

#: By case, which begins with the robot's name, the options of `nmm.load`.
BASES: dict[str, dict[str, str]] = {
    "differential_base": {},
    "differential_base as a unicycle": {"platform": "unicycle"},
    "differential_base by its wheels": {"platform": "wheeled"},
    "car_base": {},
    "car_base with front drive": {"platform": "front_drive_car"},
    "trailer_base": {},
    "trailer_base by its wheels": {"platform": "wheeled"},
    "omni_base": {},
    "omni_base with skid steering": {"platform": "skid_steer"},
}
