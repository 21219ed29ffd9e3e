"""From a Recording and a Rig to what methods read: motion, used part, noise, known constants."""
