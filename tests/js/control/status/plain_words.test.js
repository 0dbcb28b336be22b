import { describe, expect, it } from "vitest";
import {
  brief,
  distanceSensorName,
  namesOf,
  plain,
  sensorName,
  stickWords,
} from "../../../../static/js/control/status/plain_words.js";

const SONARS = [
  { name: "base_sonar_01_link", yaw: 3.927 },
  { name: "base_sonar_03_link", yaw: 2.3562 },
];

describe("plain words", () => {
  it.each([
    [0, "front distance sensor"],
    [-0.8, "front right distance sensor"],
    [Math.PI, "rear distance sensor"],
    [-Math.PI, "rear distance sensor"],
    [6.2, "front distance sensor"],
  ])("name a range sensor that looks to %s rad", (yaw, name) => {
    expect(distanceSensorName(yaw)).toBe(name);
  });

  it("stand in a bridge's sentence instead of technical names", () => {
    const text =
      "at most 0.1 m/s in reverse: sonar silent (base_sonar_01_link, base_sonar_03_link)";
    expect(plain(text, namesOf(SONARS))).toBe(
      "at most 0.1 m/s in reverse: distance sensor silent (rear right distance sensor, rear left distance sensor)",
    );
    expect(plain("between and above the sonars")).toBe("between and above the distance sensors");
  });

  it("leave out brackets with technical names only", () => {
    expect(brief("at most 0.3 m/s: sonar silent (base_sonar_01_link)")).toBe(
      "at most 0.3 m/s: distance sensor silent",
    );
    expect(brief("its lens is not known (nothing comes on /camera/info). Look.")).toBe(
      "its lens is not known. Look.",
    );
    expect(brief("no picture yet (tf has invalid numbers)")).toBe("no picture yet");
    const kept = "at most 0.1 m/s: sonar silent (base_sonar_03_link) (0.2 m/s, 640 x 480)";
    expect(brief(kept, namesOf(SONARS))).toContain(
      "(rear left distance sensor) (0.2 m/s, 640 x 480)",
    );
  });

  it("name every sensor of the list", () => {
    const known = namesOf(SONARS);
    expect(sensorName({ name: "base_sonar_03_link", kind: "sonar" }, known)).toMatch(/^rear left/);
    expect(sensorName({ name: "/scan_raw", kind: "scan" }, known)).toBe("laser scanner");
  });

  it("tell what becomes of a stick position", () => {
    expect(stickWords("dead zone 0.03, smoothed (One-Euro)")).toMatch(/^smoothed/);
    expect(stickWords("no filter")).toMatch(/as it is/);
  });
});
