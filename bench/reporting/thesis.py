"""What the thesis published: G. Waldemarson, "Packet Ray Tracing with the ARM NEON Architecture",
Lund University, 2014, tables 5.1 to 5.5, its popular summary and the factors of its chapter 6.

Configurations stand in the order of `CONFIGURATIONS`; energies are joules with half the width of
the 95 % interval.
"""

CONFIGURATIONS = ["single, scalar", "single, NEON", "packet, scalar", "packet, NEON"]
# The variants that are the same thing here.
VARIANTS = ["scalar-single-4", "vector-single-4", "scalar-packet2x2-4", "vector-packet2x2-4"]

# Scenes of the thesis, and those here that stand for them: as many triangles, alike to look at.
STAND_INS = {
    "Cornell": "builtin:cornell",
    "Sponza": "builtin:atrium",
    "Sibenik": "builtin:nave",
    "YeahRight": "builtin:handles",
}

# Table 5.1: watts at rest.
IDLE_W = {"Pandaboard": (2.8224, 0.083), "Samsung Chromebook": (2.6362, 0.075)}

# Tables 5.2 and 5.4: joules of the whole application.
ENERGY_J = {
    "Pandaboard (Cortex-A9)": {
        "Cornell": [(17, 0.60), (13, 0.86), (14, 0.10), (7, 0.72)],
        "Sponza": [(266, 32.05), (238, 1.76), (182, 0.48), (105, 0.32)],
        "Sibenik": [(164, 1.34), (163, 1.18), (128, 0.49), (75, 1.66)],
        "YeahRight": [(75, 1.59), (74, 0.29), (75, 0.97), (46, 0.86)],
    },
    "Samsung Chromebook (Cortex-A15)": {
        "Cornell": [(57, 3.41), (53, 0.86), (39, 1.07), (27, 2.07)],
        "Sponza": [(696, 4.60), (656, 5.05), (444, 2.89), (258, 8.52)],
        "Sibenik": [(349, 1.13), (334, 0.70), (218, 1.48), (138, 0.29)],
        "YeahRight": [(275, 1.59), (261, 2.04), (217, 1.76), (137, 1.16)],
    },
}

# Tables 5.3 and 5.5: the same relative to the scalar single-ray tracer, as printed.
ENERGY_RATIO = {
    "Pandaboard (Cortex-A9)": {
        "Cornell": [1.00, 1.27, 1.23, 2.44],
        "Sponza": [1.00, 1.12, 1.46, 2.52],
        "Sibenik": [1.00, 1.00, 1.28, 2.19],
        "YeahRight": [1.00, 1.02, 1.00, 1.64],
    },
    "Samsung Chromebook (Cortex-A15)": {
        "Cornell": [1.00, 1.08, 1.46, 2.10],
        "Sponza": [1.00, 1.06, 1.57, 2.69],
        "Sibenik": [1.00, 1.04, 1.60, 2.52],
        "YeahRight": [1.00, 1.05, 1.27, 2.00],
    },
}

# Popular summary: YeahRight on the Chromebook, the reference and the packet tracer.
SUMMARY = {"time_s": (32.6, 12.6), "energy_j": (225, 100)}

# Section 6.1.1: render time of the scalar single-ray tracer over that of the NEON packets.
TIME_RATIO = (2.0, 3.5)
# Section 6.1.3: two threads over one.
SCALING_RATIO = {"CoreTile Express, Pandaboard": (1.8, 1.9), "Chromebook": (1.6, 1.6)}
