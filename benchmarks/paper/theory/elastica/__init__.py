"""The static elastica from tip to force and in its limits; `discovery.theory.elastica` goes from force to tip."""
