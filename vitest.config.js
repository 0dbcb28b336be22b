import { fileURLToPath } from "node:url";
import { defineConfig } from "vitest/config";

const modules = fileURLToPath(new URL("./node_modules", import.meta.url));

export default defineConfig({
  test: {
    include: ["tests/js/**/*.test.js"],
    environment: "happy-dom",
    pool: "vmThreads", // isolates files as processes do, in a quarter of the time
    setupFiles: ["tests/js/setup.js"],
  },
  resolve: {
    // The pages import third-party modules from where Django serves them: static/vendor/NAME is NAME's dist folder.
    alias: [
      { find: /^.*\/vendor\/scene\//, replacement: `${modules}/.scene/` },
      { find: /^.*\/vendor\/([^/]+)\//, replacement: `${modules}/$1/dist/` },
    ],
  },
});
