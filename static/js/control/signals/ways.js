/**
 * How the page tells a person who looks elsewhere: sound, vibration, speech. A browser lets a page be heard only after
 * a press on it.
 */

import { pageLanguage } from "../../formats/languages.js";

const TONES = {
  stop: [
    [440, 0.16],
    [294, 0.34],
  ],
  held: [[660, 0.14]],
  lost: [
    [520, 0.14],
    [390, 0.14],
    [260, 0.34],
  ],
}; // Hz, s
const VIBRATIONS = { stop: [300], held: [120], lost: [120, 80, 120, 80, 120] }; // ms on, off, on
const LOUDNESS = 0.25;
const EDGE_S = 0.02; // a tone that begins at once would click

let audio = null;

function mayBeHeard() {
  return navigator.userActivation?.hasBeenActive ?? true;
}

function playTones(moment) {
  audio ??= new AudioContext();
  audio.resume();
  let atS = audio.currentTime + EDGE_S;
  for (const [hertz, seconds] of TONES[moment]) {
    playTone(hertz, atS, seconds);
    atS += seconds;
  }
}

function playTone(hertz, atS, seconds) {
  const [tone, volume] = [audio.createOscillator(), audio.createGain()];
  tone.frequency.value = hertz;
  volume.gain.setValueAtTime(0, atS);
  volume.gain.linearRampToValueAtTime(LOUDNESS, atS + EDGE_S);
  volume.gain.setValueAtTime(LOUDNESS, atS + seconds - EDGE_S);
  volume.gain.linearRampToValueAtTime(0, atS + seconds);
  tone.connect(volume).connect(audio.destination);
  tone.start(atS);
  tone.stop(atS + seconds);
}

function speak(_moment, words) {
  const speech = new SpeechSynthesisUtterance(words);
  speech.lang = pageLanguage();
  speechSynthesis.cancel(); // the newest counts
  speechSynthesis.speak(speech);
}

/**
 * @typedef {object} Way
 * @property {string} name of the person's choice
 * @property {boolean} isOn without a choice
 * @property {() => boolean} isThere whether this device has it
 * @property {(moment: string, words: string) => void} tell
 */

/** @type {Way[]} */
export const WAYS = [
  { name: "sound", isOn: false, isThere: () => "AudioContext" in window, tell: playTones },
  {
    name: "vibration",
    isOn: true,
    isThere: () => "vibrate" in navigator && matchMedia("(pointer: coarse)").matches,
    tell: (moment) => navigator.vibrate(VIBRATIONS[moment]),
  },
  { name: "speech", isOn: false, isThere: () => "speechSynthesis" in window, tell: speak },
].map(({ tell, ...way }) => ({
  ...way,
  tell: (moment, words) => mayBeHeard() && tell(moment, words),
}));
