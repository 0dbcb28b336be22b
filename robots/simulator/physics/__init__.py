"""Bodies: MuJoCo scene, base controller, wheels and people."""
