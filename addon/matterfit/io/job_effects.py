# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects in the job document (docs/formats.md, `scene.effects[]`)."""

from mathutils import Vector

from .. import effects
from ..jobs import JobError
from . import animation, transforms
from .files import number, numbers


class EffectPart:
    """One effect while the document is written."""

    def __init__(self, writer, index):
        self.writer = writer
        self.effect = writer.settings.effects[index]
        self.kind = effects.find(self.effect.kind)
        self._sampled = {}
        self._matrices = None
        self._start = None
        if self.effect.body and not any(
                body.enabled and body.role == "BODY" and body.name == self.effect.body
                for body in writer.settings.bodies):
            raise JobError(f"effect '{self.effect.name}': there is no body '{self.effect.body}'. "
                           "Choose another in Effects, or leave the field empty for all bodies.")
        if self.kind.has_place and self.effect.place is not None:
            if self.kind.at_rest:
                self._start = writer.place(self.effect.place)
            else:
                self._matrices = writer.keyed_matrix(self.effect.place)
        path = f"matterfit.effects[{index}]."
        for key in self.kind.numbers:
            if key in self.kind.keyed and animation.animated(writer.scene, path + key):
                self._sample(key, index)

    def _sample(self, key, index):
        values = self._sampled[key] = []
        scene = self.writer.scene
        # The collection may have moved in memory since.
        self.writer.at_every(lambda _frame, _depsgraph: values.append(
            self._written(key, getattr(scene.matterfit.effects[index], key))))

    def _written(self, key, value):
        """In the document's unit."""
        scale = self.writer.scale
        if key in effects.AREAS:
            return number(value * scale * scale)
        factor = scale if key in effects.LENGTHS else 1.0
        if hasattr(value, "__len__"):
            return numbers([part * factor for part in value])
        return number(value * factor)

    def _of_matrix(self, key, matrix):
        if key == "center":
            return numbers(matrix.translation * self.writer.scale)
        return numbers((matrix.to_3x3() @ Vector((0.0, 0.0, 1.0))).normalized())

    def _from_object(self, key):
        """What the object says of a number of effects.PLACED."""
        if self._start is not None:
            return self._of_matrix(key, self._start.matrix)
        return transforms.keyed(self.writer.frames,
                                [self._of_matrix(key, matrix) for matrix in self._matrices])

    def document(self):
        """Call after the walk."""
        document = {"effect": self.kind.name, "name": self.effect.name}
        if self.effect.body:
            document["body"] = self.effect.body
        for key in self.kind.numbers:
            if key in effects.PLACED and self.effect.place is not None:
                document[key] = self._from_object(key)
            elif key in self._sampled:
                document[key] = transforms.keyed(self.writer.frames, self._sampled[key])
            else:
                document[key] = self._written(key, getattr(self.effect, key))
        return document


def parts(writer):
    """The parts of the effects that are switched on."""
    return [EffectPart(writer, index) for index, effect in enumerate(writer.settings.effects)
            if effect.enabled]
