//! What each fault does.

use rand::RngCore;

use super::Server;
use crate::controller::{StopCause, ticks};
use crate::fault::{Fault, LinkFault, Port};

impl Server {
    pub(super) fn apply(&mut self, fault: Fault) {
        let controller = &mut self.controller;
        match fault {
            Fault::Link(port, fault) => self.apply_to_link(port, fault),
            Fault::OnlyVersion1 => self.only_version_1 = true,
            Fault::InUse(name, seconds) => {
                controller.registers.occupy(&name, true);
                self.occupied.push((self.now.saturating_add(ticks(seconds)), name));
            }
            Fault::Timestamp(seconds) => controller.clock_offset += seconds,
            Fault::Stall(seconds) => self.stalled_until = self.now + ticks(seconds),
            Fault::Reboot => {
                for link in &mut self.links {
                    link.cut(false);
                }
                controller.power_off();
                controller.clock_offset = 0.0;
                controller.clock_offset = -controller.time();
            }
            Fault::ProtectiveStop => controller.protective_stop(StopCause::Requested),
            Fault::EmergencyStop(true) => controller.emergency_stop(),
            Fault::EmergencyStop(false) => controller.release_emergency_stop(),
            Fault::SafeguardStop(true) => controller.safeguard_stop(),
            Fault::SafeguardStop(false) => controller.release_safeguard(),
            Fault::SafetyFault => controller.safety_fault("requested"),
            Fault::Slider(fraction) => controller.set_slider(fraction),
            Fault::RemoteControl(remote) => controller.set_remote_control(remote),
            Fault::KillProgram => controller.stop_program("stopped at the pendant"),
            Fault::PauseProgram => _ = controller.pause_program(),
            Fault::Sensor(fault) => controller.inject_sensor(&fault),
        }
    }

    fn apply_to_link(&mut self, port: Port, fault: LinkFault) {
        let now = self.now;
        let until = |seconds: f64| now.saturating_add(ticks(seconds));
        let impairment = self.impairments.entry(port).or_default();
        match fault {
            LinkFault::HalfOpen(seconds) => {
                impairment.mute_until = until(seconds);
                impairment.deaf_until = until(seconds);
            }
            LinkFault::Mute(seconds) => impairment.mute_until = until(seconds),
            LinkFault::Deaf(seconds) => impairment.deaf_until = until(seconds),
            LinkFault::SlowReader(bytes, seconds) => impairment.slow = (bytes, until(seconds)),
            LinkFault::Split(seconds) => impairment.split_until = until(seconds),
            LinkFault::Merge(cycles, seconds) => {
                impairment.merge = (u64::from(cycles), until(seconds));
            }
            LinkFault::Latency(mean, jitter) => {
                let none = mean == 0.0 && jitter == 0.0;
                impairment.latency = (!none).then_some((mean, jitter));
            }
            LinkFault::Drop | LinkFault::Reset => {
                let links = self.links.iter_mut().filter(|l| l.port == port);
                links.for_each(|link| link.cut(fault == LinkFault::Reset));
            }
            LinkFault::Garbage(count) => {
                let mut bytes = vec![0; count];
                self.rng.fill_bytes(&mut bytes);
                self.intrude(port, &bytes);
            }
            LinkFault::Header(size, kind) => {
                let [high, low] = size.to_be_bytes();
                self.intrude(port, &[high, low, kind]);
            }
            LinkFault::TextFlood(count) => {
                for link in self.links.iter_mut().filter(|l| l.port == port) {
                    (0..count).for_each(|i| link.text(now, &format!("message {i}")));
                }
            }
        }
    }

    fn intrude(&mut self, port: Port, bytes: &[u8]) {
        let now = self.now;
        self.links.iter_mut().filter(|l| l.port == port).for_each(|l| l.intrude(now, bytes));
    }
}
