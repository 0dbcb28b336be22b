/** The panels of the control page that `PagePanels` makes. A panel for a new kind of task is one more entry. */

import { CameraPanel } from "../../camera/camera_panel.js";
import { DriveBy } from "../../drive/drive_by.js";
import { Forget } from "../../drive/forget.js";
import { PlanView } from "../../drive/plan_view.js";
import { SpeedChart } from "../../drive/speed_chart.js";
import { GoingPanel } from "../../going/going_panel.js";
import { HeadStick } from "../../limbs/head_stick.js";
import { LimbPanel } from "../../limbs/limb_panel.js";
import { MapPanel } from "../../navigation/map_panel.js";
import { ControlPalette } from "../../palette/control_palette.js";
import { RecordingPanel } from "../../recordings/recording_panel.js";
import { ScenePanel } from "../../scene/scene_panel.js";
import { History } from "../../tasks/history.js";
import { Motions } from "../../tasks/motions.js";
import { Phrases } from "../../tasks/phrases.js";
import { Say } from "../../tasks/say.js";
import { Lichtblick } from "../../topics/lichtblick.js";
import { PlotCells } from "../../topics/plot_cells.js";
import { TopicsTab } from "../../topics/topics_tab.js";
import { Arrange } from "../layout/arrange.js";
import { ForgottenNotices } from "../status/forgotten.js";

/** In the order in which they hear news, and in which running tasks are shown. */
export const PANELS = [
  DriveBy,
  PlanView,
  CameraPanel,
  MapPanel,
  GoingPanel,
  ScenePanel,
  LimbPanel,
  HeadStick,
  SpeedChart,
  TopicsTab,
  Motions,
  Say,
  Phrases,
  History,
  Forget,
  ForgottenNotices,
  ControlPalette,
  PlotCells,
  Lichtblick,
  RecordingPanel,
  Arrange,
];
