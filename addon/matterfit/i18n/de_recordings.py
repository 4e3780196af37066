# SPDX-License-Identifier: GPL-3.0-or-later
"""German: recordings by images, splats, and what a diagnosis says."""

TEXTS = {
    "Outlines Off": "Abstand der Umrisse",
    "Worst Images": "Schlechteste Bilder",
    "Show in Cameras": "In den Kameras zeigen",
    "Outlines overlap by {share} %, in {time}": "Die Umrisse decken sich zu {share} %, in {time}",
    "{image}: {outside} pixels outside, {missing} missing": "{image}: {outside} Pixel außerhalb, {missing} fehlen",
    "There are no overlays of '{name}' in the take's folder. Compare again.":
        "Im Ordner des Takes liegen keine Überlagerungen von „{name}“. Noch einmal vergleichen.",
    "The scene has no cameras of '{name}'. Import the images with Add Cameras.":
        "Die Szene hat keine Kameras von „{name}“. Die Bilder mit Kameras importieren.",
    "Outlines overlap by {share} %, held-out ones by {held_out} %, in {time}":
        "Die Umrisse decken sich zu {share} %, zurückgehaltene zu {held_out} %, in {time}",
    "Fitted outlines overlap by {before} → {after} %, in {time}":
        "Angepasste Umrisse decken sich zu {before} → {after} %, in {time}",
    "Fitted outlines overlap by {before} → {after} %, held-out ones by {held_before} → {held_after} %, in {time}":
        "Angepasste Umrisse decken sich zu {before} → {after} %, zurückgehaltene zu {held_before} → {held_after} %, "
        "in {time}",
    "Overlap of Outlines [%]": "Überdeckung der Umrisse [%]",
    "Overlap by Camera [%]": "Überdeckung je Kamera [%]",
    "Not Held Out": "Nicht zurückgehalten",
    "Cameras": "Kameras",
    "Images are held out by frames or by cameras.": "Von Bildern werden Frames oder Kameras zurückgehalten.",
    "Fit: laws are compared by points only, and '{name}' is by images. Set Law to The Body's Law, or disable "
    "captures by images.":
        "Anpassung: Gesetze werden nur anhand von Punkten verglichen, und „{name}“ besteht aus Bildern. Als Gesetz "
        "das des Körpers wählen, oder Aufnahmen aus Bildern abschalten.",
    "Laws are compared by points only: set Law to The Body's Law, or disable captures by images.":
        "Gesetze werden nur anhand von Punkten verglichen: als Gesetz das des Körpers wählen, oder Aufnahmen aus "
        "Bildern abschalten.",
    "Render Take's pictures of what the take held before are gone, from behind the camera's view too. Render Take "
    "draws new ones.":
        "Die Bilder, die Render Take von dem zeichnete, was der Take vorher enthielt, sind gelöscht, auch hinter der "
        "Ansicht der Kamera. Render Take zeichnet neue.",
    "Needs recordings that follow the same points through time. Set Loss in Fit to Tracks, and disable captures by "
    "images.":
        "Braucht Aufnahmen, die denselben Punkten durch die Zeit folgen. Abweichung in Anpassen auf Spuren setzen, "
        "und Aufnahmen aus Bildern abschalten.",
    "misfit {share} % of the search's first step": "Abweichung {share} % vom ersten Schritt der Suche",
    "{stage}: misfit {share} % of the search's first step":
        "{stage}: Abweichung {share} % vom ersten Schritt der Suche",
    "Show Splats": "Splats zeigen",
    "Hide Splats": "Splats verbergen",
    "Render Splats": "Splats zeichnen",
    "Photograph or Splats": "Foto oder Splats",
    "Capture from Cameras": "Aufnahme aus Kameras",
    "{seen} of {count} Gaussians are shown": "{seen} von {count} Gauß-Splats werden gezeigt",
    "The active body is not made from a Gaussians file": "Der aktive Körper besteht nicht aus einer Splat-Datei",
    "The scene's camera needs a background image, and one of Render Splats":
        "Die Kamera der Szene braucht ein Hintergrundbild und eines von Splats zeichnen",
    "No camera of the scene has an image sequence behind its view":
        "Keine Kamera der Szene hat eine Bildsequenz hinter ihrer Ansicht",
    "Camera '{name}' was moved, or sees otherwise, since Render Take drew the pictures behind its view. Press Render "
    "Take again.":
        "Kamera „{name}“ wurde bewegt oder sieht anders, seit Render Take die Bilder hinter ihrer Ansicht gezeichnet "
        "hat. Render Take noch einmal drücken.",
    "Camera '{name}' shows pictures of another take than camera '{first}'. Select the cameras that show the same "
    "one, or press Render Take through each.":
        "Kamera „{name}“ zeigt Bilder eines anderen Takes als Kamera „{first}“. Die Kameras auswählen, die denselben "
        "zeigen, oder Render Take durch jede drücken.",
    "The pictures behind the view of {names} are gone: this take was not drawn through it again. It moves, is no "
    "perspective camera, or is not of the same capture as the scene's camera.":
        "Die Bilder hinter der Ansicht von {names} sind fort: dieser Take wurde nicht wieder durch sie gezeichnet. "
        "Sie bewegt sich, ist keine perspektivische Kamera oder gehört nicht zur selben Aufnahme wie die Kamera der "
        "Szene.",
    "{path}: the image does not exist. Was it moved?": "{path}: Das Bild gibt es nicht. Wurde es verschoben?",
    "Camera '{name}' moves: at frame {frame} it stands or looks otherwise than at the first. Remove its animation, "
    "or take a camera that stands still.":
        "Kamera „{name}“ bewegt sich: bei Bild {frame} steht oder blickt sie anders als beim ersten. Ihre Animation "
        "entfernen, oder eine Kamera nehmen, die still steht.",
    "Camera '{name}': '{image}' behind its view is no image sequence. Set its Source to Image Sequence.":
        "Kamera „{name}“: „{image}“ hinter ihrer Ansicht ist keine Bildsequenz. Source auf Image Sequence setzen.",
    "Camera '{name}': {path} has no number at the end of its name.":
        "Kamera „{name}“: {path} hat keine Zahl am Ende des Namens.",
    "Camera '{name}': none of the images of the sequence {path} is there. Look at its Start Frame, Offset and "
    "Frames.":
        "Kamera „{name}“: Keines der Bilder der Sequenz {path} ist da. Start Frame, Offset und Frames ansehen.",
    "Camera '{name}': its images are {w} × {h}, the scene renders {x} × {y}. Set the scene's Resolution to that "
    "of the images.":
        "Kamera „{name}“: Ihre Bilder sind {w} × {h}, die Szene rendert {x} × {y}. Die Auflösung der Szene auf die "
        "der Bilder setzen.",
    "Camera '{name}': its background image is shifted, scaled, turned or flipped. A capture takes it as it is: "
    "set these back.":
        "Kamera „{name}“: Ihr Hintergrundbild ist verschoben, skaliert, gedreht oder gespiegelt. Eine Aufnahme "
        "nimmt es, wie es ist: zurücksetzen.",
    "Diagnose": "Diagnose",
    "All Causes": "Alle Ursachen",
    "Preview Extended": "Erweitert zeigen",
    "Error [σ]": "Fehler [σ]",
    "{name}, extended": "{name}, erweitert",
    "The diagnosis has no such cause any more.": "Die Diagnose hat diese Ursache nicht mehr.",
    "{name} acts in the recording '{capture}' alone, and settings of the panel are those of all. The model that "
    "was extended by what was accepted is the job {path}, which the matterfit tool runs.":
        "{name} wirkt nur in der Aufnahme „{capture}“, und Einstellungen des Panels gelten für alle. Das um das "
        "Angenommene erweiterte Modell ist der Auftrag {path}, den das Werkzeug matterfit ausführt.",
    "The diagnosis is of the capture '{name}', which is not in the scene any more. Name it so again, or diagnose "
    "again.":
        "Die Diagnose gilt der Aufnahme „{name}“, die nicht mehr in der Szene ist. Sie wieder so nennen, oder noch "
        "einmal diagnostizieren.",
    "'{name}': Unit is Automatic, so there is no number that could be scaled. Choose the unit of its file in "
    "Capture, and diagnose again.":
        "„{name}“: die Einheit ist Automatisch, also gibt es keine Zahl, die sich skalieren ließe. Die Einheit "
        "seiner Datei unter Aufnahme wählen und noch einmal diagnostizieren.",
    "The diagnosis has accepted no cause, so there is no extended model to preview.":
        "Die Diagnose hat keine Ursache angenommen, also gibt es kein erweitertes Modell zu zeigen.",
    "{path}: holds no scene. Diagnose again.": "{path}: enthält keine Szene. Noch einmal diagnostizieren.",
    "{path} does not exist: it is an input of the fit. Diagnose again.":
        "{path} gibt es nicht: eine Eingabe der Anpassung. Noch einmal diagnostizieren.",
    "What noise makes is not known: the fit was not diagnosed. Shown in millimetres, all of it.":
        "Was Rauschen ausmacht, ist nicht bekannt: die Anpassung wurde nicht diagnostiziert. Alles in Millimetern.",
    "This recording identifies all of it:": "Diese Aufnahme bestimmt alles:",
    "This recording identifies {n} of {total} values:": "Diese Aufnahme bestimmt {n} von {total} Werten:",
    "The recording is long enough.": "Die Aufnahme ist lang genug.",
    "Diagnose {name}": "Diagnose von {name}",
    "Next recording: {text}": "Nächste Aufnahme: {text}",
    "Refine": "Verfeinern",
    "Images": "Bilder",
    "Colours": "Farben",
    "Colour Noise": "Rauschen der Farben",
    "Refine Cameras": "Kameras nachstellen",
    "Camera {n}, Shift": "Kamera {n}, Verschiebung",
    "Camera {n}, Turn": "Kamera {n}, Drehung",
    "Camera {n}, Focal Length": "Kamera {n}, Brennweite",
    "Camera Poses": "Stellung der Kameras",
    "Forget Camera Poses": "Stellung der Kameras vergessen",
    "A fit moved the cameras: up to {shift} mm and {turn}°.":
        "Eine Anpassung hat die Kameras bewegt: bis zu {shift} mm und {turn}°.",
    "No fit has moved the cameras of this capture": "Keine Anpassung hat die Kameras dieser Aufnahme bewegt",
    "Remaining error: {factor} × the recording's noise (1 is ideal)":
        "Verbleibender Fehler: {factor} × Rauschen der Aufnahme (1 ist ideal)",
    "samples lie between frames and are interpolated: Start Frame lies between two, or the recording's "
    "rate is not the scene's Frame Rate.":
        "Abtastungen liegen zwischen Bildern und werden interpoliert: das Startbild liegt zwischen zweien, "
        "oder die Rate der Aufnahme ist nicht die Bildrate der Szene.",
    "no point is seen in any frame: every place is missing. Export the recording again, or choose another "
    "file.":
        "kein Punkt ist in irgendeinem Bild zu sehen: jeder Ort fehlt. Die Aufnahme noch einmal exportieren "
        "oder eine andere Datei wählen.",
    "Every image is held out, or lies outside the frame range; nothing is left to fit to. Hold out less, or "
    "look at Start Frame, Rate and the frame range.":
        "Jedes Bild ist zurückgehalten oder liegt außerhalb des Bildbereichs; nichts bleibt zum Anpassen. "
        "Weniger zurückhalten, oder Startbild, Rate und Bildbereich ansehen.",
    "No point of the recording is seen in the simulated frames; compared in {time}":
        "Kein Punkt der Aufnahme ist in den simulierten Bildern zu sehen; verglichen in {time}",
    "'{name}' was changed while it was simulated: the result has the shape that was, but may "
    "lack UVs and colours. Bake again to have all of it.":
        "'{name}' wurde während der Simulation geändert: Das Ergebnis hat die frühere Form, und UVs oder "
        "Farben können fehlen. Noch einmal backen, um alles zu haben.",
}
