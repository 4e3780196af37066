# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that differs between Blender 3.4 and 5.x, in one place."""

import bpy

VERSION = bpy.app.version

# From 4.5 on a file property says that it understands paths that begin with //.
PATH_OPTIONS = {"PATH_SUPPORTS_BLEND_RELATIVE"} if VERSION >= (4, 5, 0) else set()


def add_group_socket(tree, name, in_out, socket_type):
    """A socket of a node group; `in_out` is 'INPUT' or 'OUTPUT'. The interface came with 4.0."""
    if hasattr(tree, "interface"):
        return tree.interface.new_socket(name=name, in_out=in_out, socket_type=socket_type)
    sockets = tree.inputs if in_out == "INPUT" else tree.outputs
    return sockets.new(socket_type, name)


def socket(sockets, name, kind=None):
    """The enabled socket of that name (nodes of 3.4 carry one of each type, all named 'Value')."""
    candidates = [item for item in sockets if item.name == name]
    if kind is not None:
        typed = [item for item in candidates if item.type == kind]
        candidates = typed or candidates
    for item in candidates:
        if item.enabled:
            return item
    if candidates:
        return candidates[0]
    raise KeyError(f"no socket '{name}' among {[item.name for item in sockets]}")


def progress_bar(layout, fraction, text):
    """UILayout.progress from 4.0; a factor drawn as text before."""
    if hasattr(layout, "progress"):
        layout.progress(factor=fraction, text=text)
        return
    filled = int(round(fraction * 16))
    row = layout.row()
    row.label(text="█" * filled + "░" * (16 - filled) + " " + text)


def flat_shader():
    """The built-in shader for one colour per vertex."""
    import gpu
    name = "SMOOTH_COLOR" if VERSION >= (4, 0, 0) else "3D_SMOOTH_COLOR"
    return gpu.shader.from_builtin(name)


def uniform_shader():
    """The built-in shader for one colour for all."""
    import gpu
    name = "UNIFORM_COLOR" if VERSION >= (4, 0, 0) else "3D_UNIFORM_COLOR"
    return gpu.shader.from_builtin(name)


def flip_mesh_cache(modifier, across):
    """Which axes a Mesh Cache modifier turns round: names of them before 4.5, three flags since."""
    if modifier.bl_rna.properties["flip_axis"].type == "ENUM":
        modifier.flip_axis = set(across)
    else:
        modifier.flip_axis = [axis in across for axis in "XYZ"]


def font_size(font, points):
    import blf
    if VERSION >= (4, 0, 0):
        blf.size(font, points)
    else:
        blf.size(font, points, 72)


def translate(text):
    """A message that is built in Python."""
    translations = bpy.app.translations
    function = getattr(translations, "pgettext_rpt", None) or translations.pgettext_tip
    return function(text)


def translate_label(text):
    return bpy.app.translations.pgettext_iface(text)


def operator_exists(path):
    """Whether this build has the operator ('wm.alembic_export')."""
    module, name = path.split(".")
    try:
        getattr(getattr(bpy.ops, module), name).get_rna_type()
    except (AttributeError, KeyError):
        return False
    return True


def move_modifier(item, name, index):
    """Moves a modifier to a place in the stack: a method from 4.1, an operator before."""
    current = item.modifiers.find(name)
    if current == index:
        return
    if hasattr(item.modifiers, "move"):
        item.modifiers.move(current, index)
        return
    with bpy.context.temp_override(object=item, active_object=item, selected_objects=[item]):
        bpy.ops.object.modifier_move_to_index(modifier=name, index=index)
