// The light or the dark theme; without a choice, the device's. Loaded in the head and not as a module, so
// that no page flashes in the wrong theme.
(() => {
  const KEY = "fleet-theme";
  const root = document.documentElement;

  function chosen() {
    try {
      return localStorage.getItem(KEY);
    } catch {
      return null;
    }
  }

  function isDark() {
    return root.dataset.theme
      ? root.dataset.theme === "dark"
      : matchMedia("(prefers-color-scheme: dark)").matches;
  }

  function choose(theme) {
    root.dataset.theme = theme;
    try {
      localStorage.setItem(KEY, theme);
    } catch {
      // Storage is forbidden: the choice is kept until the page closes.
    }
    document.dispatchEvent(new CustomEvent("fleet:theme"));
  }

  const theme = chosen();
  if (theme) root.dataset.theme = theme;
  document.addEventListener("click", ({ target }) => {
    if (target.closest?.("[data-theme-toggle]")) choose(isDark() ? "light" : "dark");
  });
})();
