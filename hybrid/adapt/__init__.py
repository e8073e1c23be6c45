"""The watch: criteria and the domain manager that will move zones (`model: adaptive`, not in this version).

Its seam: a manager looks at (Model, State) between two steps of `hybrid.motion.Motion.advance` and proposes
zones; elements are switched through Line.element, Line.spin and Line.kb, and the state is remapped there."""
