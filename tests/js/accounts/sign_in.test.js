import { describe, expect, it } from "vitest";
import { words } from "../../../static/js/accounts/sign_in.js";

describe("the place in the queue", () => {
  it("is said in words", () => {
    expect(words({ ahead: 12 })).toBe("Many people sign in. 12 people are before you…");
    expect(words({ ahead: 1 })).toBe("Many people sign in. 1 person is before you…");
    expect(words({ ahead: 0 })).toBe("Your password is being checked…");
    expect(words({ ahead: null })).toBe("Your password is being checked…");
  });
});
