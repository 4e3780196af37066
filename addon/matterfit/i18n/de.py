# SPDX-License-Identifier: GPL-3.0-or-later
"""German, but for de_recordings.py."""

from . import de_recordings

TEXTS = {
    **de_recordings.TEXTS,
    "Status": "Status",
    "Capture": "Aufnahme",
    "Captures": "Aufnahmen",
    "Bodies": "Körper",
    "Body": "Körper",
    "Collider": "Hindernis",
    "Solver": "Löser",
    "Simulate": "Simulieren",
    "Compare": "Vergleichen",
    "Overlap": "Überdeckung",
    "Press Compare first": "Zuerst Vergleichen drücken",
    "Body '{name}'": "Körper „{name}“",
    "{where}: no file is chosen. Choose one.": "{where}: keine Datei ist gewählt. Eine wählen.",
    "The scene has no object '{name}' to crop by. Choose another one, or none.":
        "Die Szene hat kein Objekt „{name}“ zum Zuschneiden. Ein anderes wählen, oder keines.",
    "{path}: Blender could not read it. Is it damaged, or of another format than its name says?":
        "{path}: Blender konnte es nicht lesen. Ist es beschädigt, oder von anderem Format als der Name sagt?",
    "Extend Model": "Modell erweitern",
    "Open Report": "Bericht öffnen",
    "Ignore": "Übergehen",
    "Accept": "Annehmen",
    "Before and After": "Vorher und nachher",
    "Limit Runs": "Läufe begrenzen",
    "Simulations": "Simulationen",
    "Significant": "Bedeutsam",
    "Explains {share}": "Erklärt {share}",
    "Found Collider": "Gefundenes Hindernis",
    "{name} is ignored. Press Accept beside it first.":
        "{name} wird übergangen. Zuerst Annehmen daneben drücken.",
    "It is animated, but starts with the velocity that is typed.":
        "Es ist animiert, startet aber mit der eingetippten Geschwindigkeit.",
    "Start as Keyed": "Start wie animiert",
    "Its keys hold still from frame {first} on: it starts at rest.":
        "Seine Keyframes ruhen ab Bild {first}: es startet aus der Ruhe.",
    "Its keys hardly turn it at frame {first}, where the simulation begins, and fastest at frame {frame}. "
    "Make them linear, or begin there: Solver > Own Range.":
        "Seine Keyframes drehen es bei Bild {first}, wo die Simulation beginnt, kaum, und bei Bild {frame} am "
        "schnellsten. Linear machen, oder dort beginnen: Solver > Own Range.",
    "Its keys set off slowly: {speed} m/s at frame {first}, where the simulation begins, {fastest} m/s at "
    "frame {frame}. Make them linear, or begin there: Solver > Own Range.":
        "Seine Keyframes setzen langsam ein: {speed} m/s bei Bild {first}, wo die Simulation beginnt, "
        "{fastest} m/s bei Bild {frame}. Linear machen, oder dort beginnen: Solver > Own Range.",
    "Select an object that is to be simulated, and press Add Body.":
        "Ein Objekt auswählen, das simuliert werden soll, und Körper hinzufügen drücken.",
    "Frame {n}: {error} mm": "Bild {n}: {error} mm",
    "{path} is damaged: it is no whole JSON file.": "{path} ist beschädigt: keine ganze JSON-Datei.",
    "Bodies: files are called after '{name}', and cannot have / or \\ in their names. Rename the row.":
        "Körper: Dateien heißen nach „{name}“, und ihre Namen können kein / und \\ enthalten. Die Zeile umbenennen.",
    "Particle Separation is {now}, and nothing can be simulated above {most}. Use a smaller one, or lower Unit "
    "Scale under Scene > Units.":
        "Der Partikelabstand ist {now}, und über {most} lässt sich nichts simulieren. Einen kleineren nehmen, "
        "oder Unit Scale unter Scene > Units senken.",
    "Time Stretching is {old} to {new}: the result would play at another speed than it is simulated at. Set Old "
    "and New to the same number under Output > Frame Range.":
        "Time Stretching ist {old} zu {new}: das Ergebnis liefe in anderem Tempo ab, als es simuliert wird. Old und "
        "New unter Output > Frame Range auf dieselbe Zahl setzen.",
    "Batch: {name} has the value {text}; its field takes from {least} to {most}.":
        "Stapel: {name} hat den Wert {text}; sein Feld nimmt Werte von {least} bis {most}.",
    "{name}: {key} is {value}, and the panel takes from {least} to {most}.":
        "{name}: {key} ist {value}, und das Panel nimmt Werte von {least} bis {most}.",
    "'{name}': {label} is {found} in the fit; its field takes from {least} to {most}":
        "„{name}“: {label} ist in der Anpassung {found}; sein Feld nimmt Werte von {least} bis {most}",
    "Check": "Prüfen",
    "Before the Fit": "Vor der Anpassung",
    "Clear": "Ausblenden",
    "Filling": "Füllen",
    "Reading the scene": "Szene lesen",
    "{name}: while the scene was read, an object or a row was removed, a row was added, another scene was "
    "shown, or Undo was pressed. Press it again.":
        "{name}: Während die Szene gelesen wurde, wurde ein Objekt oder eine Zeile entfernt, eine Zeile "
        "hinzugefügt, eine andere Szene gezeigt oder Rückgängig gedrückt. Noch einmal drücken.",
    "{n} of {total} done": "{n} von {total} fertig",
    "nothing recorded shows it": "nichts Aufgenommenes zeigt ihn",
    "unknown: {error}": "unbekannt: {error}",
    "Tied: {names}. Only a combination is identified: set one of them, and switch it off in the list.":
        "Gekoppelt: {names}. Nur eine Verbindung ist bekannt: einen davon eintragen und in der "
        "Liste ausschalten.",
    "The frame rate suffices.": "Die Bildrate genügt.",
    "The noise is small enough.": "Das Rauschen ist klein genug.",
    "Record instead: {text}": "Besser aufnehmen: {text}",
    "{names} and {last}": "{names} und {last}",
    "{share} likely": "{share} wahrsch.",
    "Gain {share}": "Gewinn {share}",
    "Held-out error {before} → {after} mm": "Zurückgehaltener Fehler {before} → {after} mm",
    "Not observable: {names}": "Nicht beobachtbar: {names}",
    "Looks like: {names}": "Sieht aus wie: {names}",
    "{n} particle": "{n} Teilchen",
    "{n} particles": "{n} Teilchen",
    "{n} frame": "{n} Bild",
    "{n} frames": "{n} Bilder",
    "{n} cell": "{n} Zelle",
    "{n} cells": "{n} Zellen",
    "{n} layer": "{n} Lage",
    "{n} layers": "{n} Lagen",
    "Particle Separation is {now}, and nothing can be simulated below {least}: what is simulated is "
    "very small. Scale it up, or raise Unit Scale under Scene > Units.":
        "Der Partikelabstand ist {now}, und unter {least} ist nichts zu simulieren: Was simuliert wird, "
        "ist sehr klein. Es vergrößern, oder unter Szene > Einheiten die Einheitenskalierung erhöhen.",
    "{name}: its hair is not on the result, as modifiers make another mesh. Grow it on the result.":
        "{name}: das Haar ist nicht am Ergebnis, weil Modifikatoren ein anderes Netz machen. Es am "
        "Ergebnis wachsen lassen.",
    "Use a smaller Particle Separation, or gentler motion.":
        "Einen kleineren Partikelabstand oder sanftere Bewegung wählen.",
    "Use a smaller Particle Separation, gentler motion, or the Formulation Updated Lagrangian if the body "
    "flows or tears.":
        "Einen kleineren Partikelabstand, sanftere Bewegung oder die Formulierung Updated Lagrangian "
        "wählen, wenn der Körper fließt oder reißt.",
    "{body} starts up to {depth} inside {other}.": "{body} beginnt bis zu {depth} in {other}.",
    "Parts of the mesh of '{name}' lie up to {distance} outside the shape that is simulated, and may "
    "not follow it well. Apply the modifiers if it does not.":
        "Teile des Netzes von „{name}“ liegen bis zu {distance} außerhalb der simulierten Form und "
        "folgen ihr vielleicht nicht gut. Dann die Modifikatoren anwenden.",
    "The thinnest side holds only {layers} of particles: lower Particle Separation.":
        "In die dünnste Seite passen nur {layers} von Teilchen: Partikelabstand verringern.",
    "The mesh had a hole, which was closed straight across.": "Das Netz hatte ein Loch, das gerade geschlossen wurde.",
    "The mesh had {n} holes, which were closed straight across.":
        "Das Netz hatte {n} Löcher, die gerade geschlossen wurden.",
    "A Particle Separation of {now} makes too many particles. Use at least {least}.":
        "Ein Partikelabstand von {now} gibt zu viele Teilchen. Mindestens {least} nehmen.",
    "A Particle Separation of {now} is too large for this shape. Use a smaller one, or check that the "
    "shape is closed and its size is right.":
        "Ein Partikelabstand von {now} ist zu groß für diese Form. Einen kleineren nehmen, oder "
        "prüfen, ob die Form geschlossen und ihre Größe richtig ist.",
    "A Particle Separation of {now} is too large for the wires and walls of this shape: particles would "
    "hold {share} % of it. Use a smaller one, raise Most Particles, or make them thicker.":
        "Ein Partikelabstand von {now} ist zu groß für die Drähte und Wände dieser Form: {share} % davon "
        "hätten Partikel. Einen kleineren nehmen, Most Particles erhöhen oder sie dicker machen.",
    "This makes {particles}, more than Most Particles in Solver: shapes have changed. Press Set from "
    "Quality there; Quality: Custom keeps the separation.":
        "Das macht {particles}, mehr als Most Particles im Löser: Die Formen haben sich geändert. Dort "
        "Set from Quality drücken; Quality: Custom behält den Partikelabstand.",
    "The surface crosses itself in places.": "Die Oberfläche durchdringt sich stellenweise.",
    "In places more than two faces share an edge.": "Stellenweise teilen sich mehr als zwei Flächen eine Kante.",
    "Faces looked inward and were turned outward.":
        "Flächen zeigten nach innen und wurden nach außen gewendet.",
    "Some faces looked the other way than their neighbours and were turned.":
        "Einige Flächen zeigten anders herum als ihre Nachbarn und wurden gewendet.",
    "Vertices at the same place were joined.": "Eckpunkte an derselben Stelle wurden verbunden.",
    "{particles}; volume matched.": "{particles}; Volumen getroffen.",
    "{particles}, which hold {share} % of the volume.": "{particles}, die {share} % des Volumens halten.",
    "Batch": "Stapel",
    "Vary": "Variieren",
    "At Once": "Zugleich",
    "Run Batch": "Stapel rechnen",
    "Write Jobs": "Aufträge schreiben",
    "Load Results": "Ergebnisse laden",
    "This Machine": "Dieser Rechner",
    "{n} simulations": "{n} Simulationen",
    "{n} fits": "{n} Anpassungen",
    "{names}: mean error": "{names}: mittlerer Fehler",
    "{names}: error after the fit": "{names}: Fehler nach der Anpassung",
    "Best: {values} with {error}": "Am besten: {values} mit {error}",
    "Batch: {n} of {total} are fitted": "Stapel: {n} von {total} sind angepasst",
    "{n} jobs in {folder}": "{n} Aufträge in {folder}",
    "Batch: {n} of {total} are takes now": "Stapel: {n} von {total} sind jetzt Takes",
    "Batch: nothing is varied. Press Vary, and type values.":
        "Stapel: nichts wird variiert. Variieren drücken und Werte eintippen.",
    "Batch: {name} has no values yet. Type numbers separated by commas, such as 1, 2, 3.":
        "Stapel: {name} hat noch keine Werte. Zahlen eintippen, durch Kommas getrennt: 1, 2, 3.",
    "Batch: {name} has the value {text} twice.": "Stapel: {name} hat den Wert {text} zweimal.",
    "Batch: {n} combinations are more than {most}. Take out some values.":
        "Stapel: {n} Kombinationen sind mehr als {most}. Einige Werte weglassen.",
    "a part of it is turned inside out": "ein Teil von ihm ist umgestülpt",
    "a part of it moves too fast": "ein Teil von ihm ist zu schnell",
    "a part of it is torn away": "ein Teil von ihm ist abgerissen",
    "a part of it ": "ein Teil von ihm ",
    "The thinnest part is {thickness}, as thick as {layers}: it bends and breaks too easily. Make it "
    "{least} thick, or {more}.":
        "Der dünnste Teil misst {thickness}, so viel wie {layers}: er biegt sich und bricht zu leicht. "
        "Ihn {least} dick machen, oder {more}.",
    "raise Most Particles": "mehr Partikel erlauben",
    "lower Particle Separation": "den Partikelabstand verkleinern",
    "{what}: {path} is a folder. Choose a file in it.":
        "{what}: {path} ist ein Ordner. Eine Datei darin wählen.",
    "Rerun": "Wiederholen",
    "Output": "Ausgabe",
    "Material Preset": "Material-Vorlage",
    "Law": "Gesetz",
    "Density [kg/m³]": "Dichte [kg/m³]",
    "Young's Modulus [Pa]": "Elastizitätsmodul [Pa]",
    "Poisson's Ratio": "Querkontraktionszahl",
    "Poisson's": "Querkontr.",
    "Yield Stress": "Fließgrenze",
    "Hardening": "Verfestigung",
    "Viscosity": "Viskosität",
    "Exponent": "Exponent",
    "Cohesion": "Kohäsion",
    "Bulk Modulus": "Kompression",
    "Modulus": "Modul",
    "Graph": "Kurve",
    "Red At": "Rot bei",
    "Focal": "Brennweite",
    "Young's": "E-Modul",
    "Yield": "Fließgrenze",
    "Shear": "Scherung",
    "Bulk": "Volumen",
    "Time": "Zeit",
    "Thinning": "Verdünnung",
    "Stiffness": "Steifigkeit",
    "Fit's Error": "Fehler der Anpassung",
    "Attach At": "Anhängen bei",
    "Meshes": "Netze",
    "Own Gravity": "Eigene Schwerkraft",
    "Coeff.": "Beiwert",
    "Wind": "Wind",
    "Accel.": "Beschl.",
    "Freq.": "Frequenz",
    "Added": "Zusätzlich",
    "Slope": "Anstieg",
    "Area": "Fläche",
    "Density": "Dichte",
    "Damping": "Dämpfung",
    "95 % Below": "95 % unter",
    "Jobs For": "Aufträge für",
    "Spin": "Drehung",
    "Gravity": "Schwerkraft",
    "Preset": "Vorlage",
    "Simulation": "Simulation",
    "Yield Stress [Pa]": "Fließspannung [Pa]",
    "Viscosity [Pa s]": "Viskosität [Pa s]",
    "Particle Separation": "Partikelabstand",
    "Quality": "Qualität",
    "Preview": "Vorschau",
    "Standard": "Standard",
    "Fine": "Fein",
    "Bake": "Backen",
    "Resume": "Fortsetzen",
    "Free": "Freigeben",
    "Cancel": "Abbrechen",
    "Verify": "Prüfen",
    "Remove": "Entfernen",
    "Copy": "Kopieren",
    "Ground": "Boden",
    "Container": "Behälter",
    "Friction": "Reibung",
    "Velocity": "Geschwindigkeit",
    "Gravity [m/s²]": "Schwerkraft [m/s²]",
    "Import Capture": "Aufnahme importieren",
    "Add Body": "Körper hinzufügen",
    "Add Collider": "Hindernis hinzufügen",
    "Add Take": "Take hinzufügen",
    "Take 1": "Take 1",
    "Pins": "Halterungen",
    "Masses": "Massen",
    "Up Axis": "Hochachse",
    "Hold-out": "Zurückgehalten",
    "Noise": "Rauschen",
    "Shift": "Verschiebung",
    "Turn": "Drehung",
    "Focal Length": "Brennweite",
    "Focal lengths: up to {share} % off.": "Brennweiten: bis zu {share} % daneben.",
    "Fit": "Anpassen",
    "The Body's Law": "Das Gesetz des Körpers",
    "Find the Law": "Gesetz suchen",
    "Candidates": "Kandidaten",
    "Loss": "Abweichung",
    "Tracks": "Spuren",
    "Loss Curve": "Verlauf der Anpassung",
    "Error of the Fit": "Fehler der Anpassung",
    "Stress Curves": "Spannungskurven",
    "Pulled": "Gezogen",
    "Pulled Two Ways": "Zweiachsig gezogen",
    "Sheared": "Geschert",
    "{name}: 'excited' does not hold strains and two rates.":
        "{name}: „excited“ enthält nicht Dehnungen und zwei Raten.",
    "Start": "Start",
    "Bounds": "Grenzen",
    "Lowest": "Mindestens",
    "Highest": "Höchstens",
    "Within ±": "Innerhalb ±",
    "Prior": "Vorwissen",
    "Expected": "Erwartet",
    "Deviation": "Abweichung des Vorwissens",
    "Axes": "Achsen",
    "Iterations": "Iterationen",
    "Growing Windows": "Wachsende Zeitfenster",
    "Resolutions": "Auflösungen",
    "Huber Threshold": "Huber-Schwelle",
    "Advanced": "Erweitert",
    "Result": "Ergebnis",
    "Resume Fit": "Anpassung fortsetzen",
    "Free Fit": "Anpassung freigeben",
    "List Parameters": "Parameter auflisten",
    "Apply to Body": "Auf Körper anwenden",
    "Save Material": "Material speichern",
    "Load Material": "Material laden",
    "Add to Presets": "Zu den Vorlagen hinzufügen",
    "Remove Preset": "Vorlage entfernen",
    "Relaxation": "Relaxation",
    "Add Branch": "Zweig hinzufügen",
    "Remove Branch": "Zweig entfernen",
    "Branch": "Zweig",
    "Relaxation Time [s]": "Relaxationszeit [s]",
    "Shear Damping [Pa s]": "Scherdämpfung [Pa s]",
    "Bulk Damping [Pa s]": "Volumendämpfung [Pa s]",
    "Hardening [Pa]": "Verfestigung [Pa]",
    "Flow Exponent": "Fließexponent",
    "Unknown": "Unbekannt",
    "Two networks of a file, as NCLaw publishes and trains them. It has no numbers that a fit could "
    "find; All Weights of a fit moves what the networks learned":
        "Zwei Netze aus einer Datei, wie NCLaw sie veröffentlicht und anlernt. Zahlen, die eine Anpassung "
        "finden könnte, hat es nicht; Alle Gewichte in einer Anpassung bewegt, was die Netze gelernt "
        "haben",
    "Choose a file of weights for this law.": "Für dieses Gesetz eine Datei mit Gewichten wählen.",
    "Kind of Material": "Art des Materials",
    "Pours": "Fließt",
    "Numbers": "Zahlen",
    "All Weights": "Alle Gewichte",
    "Correction": "Korrektur",
    "Most like {law}": "Am ähnlichsten: {law}",
    "Predicted to ± {size} mm (95 %); {share} % of what was held out lie within":
        "Vorhergesagt auf ± {size} mm (95 %); {share} % des Zurückgehaltenen liegen darin",
    "Then: {laws}": "Dann: {laws}",
    "{n} of {total} numbers are identified": "{n} von {total} Zahlen sind bestimmt",
    "{n} at their bounds": "{n} an ihren Grenzen",
    "{name}: {n} of {total}": "{name}: {n} von {total}",
    "Not known yet: an elastic solid. Fit, with the law Unknown, finds what it is.":
        "Noch nicht bekannt: ein elastischer Körper. Anpassen mit dem Gesetz Unbekannt findet, was es "
        "ist.",
    "Its stiffness and what kind of material it is are looked for, whatever law the body has now.":
        "Seine Steifigkeit und die Art des Materials werden gesucht, welches Gesetz der Körper jetzt "
        "auch hat.",
    "Eight numbers, looked for together from all kinds of material.":
        "Acht Zahlen, die zusammen unter allen Arten von Material gesucht werden.",
    "{name}: '{key}' is not a list of {n} numbers.": "{name}: '{key}' ist keine Liste von {n} Zahlen.",
    "Weights": "Gewichte",
    "Weights File": "Gewichtsdatei",
    "Yield Strain": "Fließdehnung",
    "Internal Friction": "Innere Reibung",
    "Strain Hardening": "Dehnungsverfestigung",
    "Tear Strain": "Trenndehnung",
    "Flow Rate [1/s]": "Fließrate [1/s]",
    "Flow Thinning [1/s]": "Fließverdünnung [1/s]",
    "Friction Angle [°]": "Reibungswinkel [°]",
    "Cohesion [Pa]": "Kohäsion [Pa]",
    "Bulk Modulus [Pa]": "Kompressionsmodul [Pa]",
    "Velocity [m/s]": "Geschwindigkeit [m/s]",
    "Position [m]": "Ort [m]",
    "Rotation [rad]": "Rotation [rad]",
    "Height [m]": "Höhe [m]",
    "Start Frame": "Startbild",
    "Stiffness [Pa/m]": "Steifigkeit [Pa/m]",
    "Nothing": "Nichts",
    "Last Frames": "Letzte Bilder",
    "Whole Capture": "Ganze Aufnahme",
    "Points": "Punkte",
    "Both": "Beides",
    "From": "Ab",
    "Error [mm]": "Fehler [mm]",
    "Before": "Vorher",
    "After": "Nachher",
    "Fitted": "Angepasst",
    "Held Out": "Zurückgehalten",
    "Probability": "Wahrscheinlichkeit",
    "At its bound": "An seiner Grenze",
    "Error of the fit; blue: held out": "Fehler der Anpassung; blau: zurückgehalten",
    "{stage}: rms {error} mm": "{stage}: quadratisches Mittel {error} mm",
    "{value}, not observable": "{value}, nicht beobachtbar",
    "Grid: ± {error}": "Gitter: ± {error}",
    "95 %: {low} to {high}": "95 %: {low} bis {high}",
    "The scene changed since this bake: {changes}.":
        "Die Szene hat sich seit diesem Backen geändert: {changes}.",
    "The scene changed since this fit: {changes}.":
        "Die Szene hat sich seit dieser Anpassung geändert: {changes}.",
    "{what} was {before}, now {now}": "{what} war {before}, jetzt {now}",
    "Cancelled: the best so far. Resume goes on.": "Abgebrochen: das Beste bis dahin. Fortsetzen geht weiter.",
    "'{name}' is loaded": "„{name}“ ist geladen",
    "Doubtful: {reason}": "Zweifelhaft: {reason}",
    "Not converged: {reason}": "Nicht konvergiert: {reason}",
    "Fit {name}": "Anpassen: {name}",
    "Fitted error {before} → {after} mm, in {time}":
        "Fehler der Anpassung {before} → {after} mm, in {time}",
    "Held-out error {before} → {after} mm, in {time}":
        "Fehler im Zurückgehaltenen {before} → {after} mm, in {time}",
    "The fitted values are set. Bake or Compare uses them":
        "Die angepassten Werte sind gesetzt. Backen und Vergleichen verwenden sie",
    "'{name}' is among the material presets": "'{name}' ist bei den Material-Vorlagen",
    "There is no capture to fit to.": "Es gibt keine Aufnahme zum Anpassen.",
    "There is no capture to fit to. Import one in Capture, or enable it.":
        "Es gibt keine Aufnahme zum Anpassen. Unter Aufnahme eine importieren oder einschalten.",
    "Every capture is held out whole, so nothing is left to fit to. Set Hold-out of one to Nothing "
    "or Last Frames.":
        "Jede Aufnahme ist ganz zurückgehalten, es bleibt nichts zum Anpassen. Bei einer unter "
        "Zurückgehalten Nichts oder Letzte Bilder wählen.",
    "Fit: no parameter is switched on. Switch on at least one in the list.":
        "Anpassen: Kein Parameter ist eingeschaltet. Mindestens einen in der Liste einschalten.",
    "Nothing is held out: how well the fit predicts will not be known.":
        "Nichts ist zurückgehalten: Wie gut die Anpassung vorhersagt, bleibt unbekannt.",
    "The result of the fit cannot be read. Fit again.":
        "Das Ergebnis der Anpassung ist nicht lesbar. Neu anpassen.",
    "What distinguishes a law from the body's own is looked for as well.":
        "Was ein Gesetz von dem des Körpers unterscheidet, wird mit gesucht.",
    "Press Fit to begin afresh.": "Anpassen drücken, um neu zu beginnen.",
    "cancelling": "wird abgebrochen",
    "Blender uses {size}": "Blender belegt {size}",
    "frame {n} of {total}": "Bild {n} von {total}",
    "{time} left": "noch {time}",
    "The .blend file is not saved, so there is no folder for the cache. Save the file first "
    "(File > Save).":
        "Die .blend-Datei ist nicht gespeichert, also gibt es keinen Ordner für den Cache. "
        "Zuerst speichern (Datei > Speichern).",
    "This take was not baked yet. Press Bake.":
        "Dieser Take ist noch nicht gebacken. Backen drücken.",
    "Another job is running: cancel it first":
        "Ein anderer Auftrag läuft: zuerst abbrechen",
    "There is no result: press Fit first": "Es gibt kein Ergebnis: zuerst Anpassen drücken",
    "Nothing was fitted yet: press Fit": "Noch ist nichts angepasst: Anpassen drücken",
    "This take was not baked yet: press Bake":
        "Dieser Take ist noch nicht gebacken: Backen drücken",
    "Add a body first": "Zuerst einen Körper hinzufügen",
    "of the animation": "aus der Animation",
    "object '{name}': its location, rotation or scale is not a number. Look at its keys, drivers and "
    "constraints.":
        "Objekt „{name}“: Position, Rotation oder Skalierung ist keine Zahl. Keyframes, Treiber und "
        "Constraints ansehen.",
    "'{name}' is flat: its Scale, or a parent's, is 0 along an axis. Give it another one.":
        "„{name}“ ist flach: seine Skalierung oder die eines Elternobjekts ist entlang einer Achse 0. Eine "
        "andere eintragen.",
    "{path} is not a number. Type one; where a driver or an expression sets it, mend that.":
        "{path} ist keine Zahl. Eine eintippen; wo ein Treiber oder ein Ausdruck den Wert setzt, diesen "
        "richtigstellen.",
    "Cancelled: the best so far.": "Abgebrochen: das Beste bis dahin.",
    "The fit is unfinished, and begins at other values now: undo this before Resume":
        "Die Anpassung ist unfertig und beginnt jetzt bei anderen Werten: vor Fortsetzen dies "
        "rückgängig machen",
    "Save the .blend file now: without that, a fit that is killed with Blender cannot be resumed":
        "Jetzt die .blend-Datei speichern: sonst ist eine Anpassung, die mit Blender abbricht, "
        "nicht fortzusetzen",
    "the ground": "dem Boden",
    " (now {stiffness} Pa/m)": " (jetzt {stiffness} Pa/m)",
    "{body} sank {depth} into {other}. Raise {field}{now} if it should not.":
        "{body} ist {depth} in {other} eingesunken. {field}{now} erhöhen, wenn das nicht sein "
        "soll.",
    "{n} of {total} samples lie outside the simulated frames, and are not compared.":
        "{n} von {total} Abtastungen liegen außerhalb der simulierten Bilder und werden nicht "
        "verglichen.",
    "points lie up to {distance} off {body} at rest. Are the capture's Unit, Location, Rotation "
    "and Start Frame right?":
        "Punkte liegen in Ruhe bis zu {distance} neben {body}. Stimmen Einheit, Position, "
        "Rotation und Startbild der Aufnahme?",
    "Every sample is held out, not seen, before the end of Quiet Start, or outside the frame range; nothing "
    "is left to fit to ({covered}). Hold out less, or look at Quiet Start, Start Frame, the frame range and "
    "the file's times, which are in seconds.":
        "Jede Abtastung ist zurückgehalten, nicht zu sehen, vor dem Ende der Ruhe zu Beginn oder außerhalb des "
        "Bildbereichs; nichts bleibt zum Anpassen ({covered}). Weniger zurückhalten, oder Ruhe zu Beginn, "
        "Startbild, Bildbereich und die Zeiten der Datei ansehen, die in Sekunden sind.",
    "Frame {n} would need too many steps in time ({why}). Soften the material or what it touches, slow it "
    "down, or use a larger Particle Separation.":
        "Bild {n} brauchte zu viele Zeitschritte ({why}). Das Material oder was es berührt weicher machen, "
        "langsamer werfen, oder einen größeren Partikelabstand nehmen.",
    "{where}: the hold-out starts at frame {n}, after the last frame {last}. Set From, below Hold-out, to an "
    "earlier frame, or let the frame range reach further.":
        "{where}: das Zurückgehaltene beginnt bei Bild {n}, nach dem letzten Bild {last}. Von, unter "
        "Zurückhalten, auf ein früheres Bild setzen, oder den Bildbereich weiter reichen lassen.",
    "No checkpoint was found: simulated from the first frame.":
        "Kein Sicherungspunkt gefunden: vom ersten Bild an simuliert.",
    "Went on after frame {n}.": "Nach Bild {n} fortgesetzt.",
    "Law: {law}": "Gesetz: {law}",
    "This take is one of a batch. Compare it or write its job in Batch, or choose another take in "
    "Rerun.":
        "Dieser Take gehört zu einem Stapel. Unter Stapel vergleichen oder dort seinen Auftrag "
        "schreiben, oder einen anderen Take wählen.",
    "This take is that of the scene that was copied, and is linked, read-only. Press Bake to make "
    "one of its own.":
        "Dieser Take gehört der kopierten Szene und ist nur lesend verknüpft. Backen drücken, um "
        "einen eigenen zu machen.",
}
