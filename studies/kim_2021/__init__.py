"""Kim, Choi & Jang 2021, maximum performance and time-optimal motion: ``python -m studies.kim_2021``.

Figures 5, 6, 8 and 9 and Table 4. The paper prints no masses (0.5 kg per link here), no angle of the base, and not how
postures follow a path: speeds and energies depend on them. The sliders' speeds need postures that jump; results without
jumps are here too.
"""
