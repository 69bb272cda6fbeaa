//! One frame, and what it leaves in the trace.

use super::panels::Sight;
use super::{App, FRAME};
use crate::content::Content;
use crate::screen::Presented;
use crate::trace::{Took, Watch};
use serde_json::{Map, Value, json};
use std::time::Instant;
use winit::event_loop::ActiveEventLoop;

impl App {
    /// One frame.
    pub(super) fn draw(&mut self, event_loop: &ActiveEventLoop) {
        // 1. Time passes.
        let (now, watch) = (Instant::now(), Watch::start());
        let seconds = (now - self.last_frame).as_secs_f64();
        self.last_frame = now;
        self.state.step(seconds);
        if let Some(request) = self.state.wanted() {
            self.worker.ask(request);
        }
        let step = watch.took();
        // 2. What is to be painted.
        let (Some(pane), Some(shows)) = (&mut self.pane, &mut self.shows) else {
            return;
        };
        let watch = Watch::start();
        let input = pane.take_input();
        let mut painted = pane.panels.run(
            input,
            Sight {
                state: &mut self.state,
                shows,
                status: &self.status,
                shown: self.shown.as_ref(),
                plan: self.plan.as_ref(),
            },
        );
        let platform = std::mem::take(&mut painted.platform);
        pane.input.handle_platform_output(&pane.window, platform);
        let all = watch.took();
        let [_, tessellate] = painted.took;
        // With what the window system is told.
        let panels = Took {
            ms: all.ms - tessellate.ms,
            cpu_ms: all.cpu_ms - tessellate.cpu_ms,
        };
        self.wake = painted.delay.map(|delay| now + delay.max(FRAME));
        // 3. It is painted.
        let watch = Watch::start();
        pane.screen.upload(&painted.textures);
        let upload = watch.took();
        let watch = Watch::start();
        let presented = pane
            .screen
            .present(&painted.primitives, painted.pixels_per_point);
        pane.screen.free(&painted.textures);
        painted.textures.clear();
        let draw = watch.took();
        self.frames += 1;
        let steps = [
            ("events", std::mem::take(&mut self.events)),
            ("step", step),
            ("panels", panels),
            ("tessellate", tessellate),
        ];
        self.status.step_ms = steps.iter().map(|s| s.1.ms).fold(0.0, f64::max);
        self.status.draw_ms = upload.ms + draw.ms;
        if presented == Presented::Yes {
            self.trace_frame(&steps, [upload, draw]);
            self.presented(now);
        }
        let watch = Watch::start();
        for command in std::mem::take(&mut painted.commands) {
            self.do_command(command);
            self.redraw();
        }
        self.events += watch.took();
        match presented {
            Presented::Yes | Presented::NotNow => {}
            Presented::Again => self.redraw(),
            Presented::Lost => self.reopen(event_loop),
        }
    }

    fn trace_frame(&self, steps: &[(&str, Took)], [upload, draw]: [Took; 2]) {
        let Some(trace) = &self.trace else {
            return;
        };
        let state = &self.state;
        let pose = state.pose();
        let forward = pose.rotation.conjugate() * glam::DVec3::Z;
        let size = self.window.as_ref().map(|window| window.inner_size());
        let scale = self.pane.as_ref().map(|pane| pane.panels.scale());
        let of = |value: fn(&Took) -> f64| -> Map<String, Value> {
            let values = steps.iter();
            let values = values.map(|(name, took)| ((*name).to_owned(), json!(value(took))));
            values.collect()
        };
        let picture = self.shown.as_ref().map(|s| {
            json!({
                "id": s.id,
                "revision": s.revision,
                "reduction": s.reduction,
                "ms": s.time_ms(),
                "stages": s.stages,
                "center": s.view.center().to_array(),
                "layer": state.look.layer.name(),
                "is_settled": state.is_settled(s),
                "photo": s.photo.as_ref().map(|p| p.0),
            })
        });
        let cell = match (state.content(), state.cell()) {
            (Some(Content::Interior(house)), Some(id)) => Some(&house.interior.cell(id).name),
            _ => None,
        };
        trace.add(json!({
            "frame": self.frames,
            "t_ms": 1e3 * self.start.elapsed().as_secs_f64(),
            "center": pose.center().to_array(),
            "forward": forward.to_array(),
            "mode": state.mode.name(),
            "cell": cell,
            "stop": state.stop(),
            "support": state.support,
            "size": size.map(|s| [s.width, s.height]),
            "scale": scale,
            "picture": picture,
            "wipe": state.wipe,
            "keyframes": state.keyframes.len(),
            "is_playing": state.is_playing(),
            "doing": self.status.doing,
            "said": self.status.said,
            "failed": self.status.failed,
            "losses": self.losses,
            "steps_ms": of(|took| took.ms),
            "steps_cpu_ms": of(|took| took.cpu_ms),
            "upload_ms": upload.ms,
            "draw_ms": draw.ms,
        }));
    }
}
