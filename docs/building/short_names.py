"""Names in signatures lead to the page of the public name: nmm.model.robots.robot.Robot is nmm.Robot."""

from typing import Any

#: Where public names are, in the order in which one is looked for.
PUBLIC = ("nmm", "nmm.analysis", "nmm.playback", "nmm.figures", "nmm.driving", "nmm.rendering", "nmm.ros")


def short_name(app: Any, env: Any, node: Any, contnode: Any) -> Any:
    """The reference to a name of ours that is documented under another one; None for any other."""
    target = node.get("reftarget", "")
    name = target.rpartition(".")[2]
    if node.get("refdomain") != "py" or not name:
        return None
    domain = env.get_domain("py")
    for room in PUBLIC:
        if f"{room}.{name}" in domain.objects:
            found = domain.objects[f"{room}.{name}"]
            if found.aliased or (target != name and not target.startswith("nmm")):
                continue
            return domain.resolve_xref(
                env, node["refdoc"], app.builder, "obj", f"{room}.{name}", node, contnode
            )
    return None
