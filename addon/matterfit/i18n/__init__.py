# SPDX-License-Identifier: GPL-3.0-or-later
"""Translations: one module a language with a dictionary TEXTS. Panel labels, descriptions and
messages are looked up by their English text; what is missing stays English."""

import bpy

from . import de

# Blender's German was de_DE up to 4.5 and is de from then on.
_LANGUAGES = {"de_DE": de.TEXTS, "de": de.TEXTS}


def dictionary():
    """Blender's form: {language: {(context, english): translation}}."""
    contexts = ("*", "Operator")
    return {language: {(context, english): text for english, text in texts.items()
                       for context in contexts}
            for language, texts in _LANGUAGES.items()}


def register(module):
    bpy.app.translations.register(module, dictionary())


def unregister(module):
    bpy.app.translations.unregister(module)
