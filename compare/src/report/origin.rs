//! What was measured on what: device, driver, host, program, settings.

use super::chapter::Chapter;
use super::number::{bytes, count, gap, grouped, short, text};
use crate::select;
use maud::{Markup, html};
use record::{DeviceKind, Method, Parameters, Record};

/// All in one line.
pub fn line(record: &Record) -> Markup {
    // As the vendor writes it, where Vulkan has nothing but a number.
    let driver = &record.device.driver;
    let driver = if driver.info.is_empty() { &driver.version } else { &driver.info };
    html! {
        (record.device.name) ", driver " (text(driver)) ", "
        (record.run.width) "×" (record.run.height) ", " (record.started)
    }
}

/// The facts, in groups.
pub fn markup(chapter: &Chapter) -> Markup {
    let record = chapter.selection.record;
    let (device, host, run) = (&record.device, &record.host, &record.run);
    let kind = match device.kind {
        DeviceKind::Discrete => "GPU with memory of its own",
        DeviceKind::Integrated => "GPU that shares the host's memory",
        DeviceKind::Virtual => "GPU of a virtual machine",
        DeviceKind::Cpu => "driver that runs on the CPU",
        DeviceKind::Other => "other",
    };
    html! {
        dl.facts {
            (fact("Device", html! { (device.name) " (" (device.vendor) ", " (kind) ")" }))
            (fact("Driver", html! { (device.driver.name) " " (text(&device.driver.version))
                @if !device.driver.info.is_empty() { " (" (device.driver.info) ")" } }))
            (fact("Vulkan", text(&device.api_version)))
            (fact("UUID", text(&device.uuid)))
            @if let Some(pci) = &device.pci { (fact("PCI address", text(pci))) }
            (fact("Memory", html! {
                @if device.limits.heaps.is_empty() { (gap("not recorded")) }
                @for (index, heap) in device.limits.heaps.iter().enumerate() {
                    @if index > 0 { ", " } (bytes(heap.bytes)) @if heap.device_local { " of its own" }
                }
            }))
            @if let Some(name) = &host.name { (fact("Computer", text(name))) }
            (fact("CPU", html! { (text(&host.cpu)) @if host.cores > 0 { ", " (count(host.cores as usize, "core")) } }))
            (fact("Main memory", if host.memory_bytes > 0 { html! { (bytes(host.memory_bytes)) } } else { gap("not recorded") }))
            (fact("System", html! { (text(&host.os)) ", " (text(&host.kernel)) }))
            (fact("Program", html! { (record.tool.name) " " (record.tool.version) }))
            (fact("Commit", match &record.tool.commit {
                Some(commit) => html! { code { (commit.hash) } @if commit.dirty { " with changes" } },
                None => gap("not recorded"),
            }))
            (fact("Command", command(&record.command_line)))
            (fact("When", html! { (record.started) " to "
                @match record.finished { Some(end) => (end), None => "… (interrupted, or still under way)" } }))
            (fact("Picture", html! { (run.width) "×" (run.height) " pixels" }))
            (fact("Samples", match &run.stopping {
                Some(stopping) => html! {
                    (stopping.least) " to " (stopping.most) " a view, until both rates are known to ±"
                    (short(100.0 * stopping.half_width)) "%, or for " (short(stopping.seconds)) " s a point"
                },
                None => html! { (run.samples) " a view" },
            }))
            @if run.method == Method::Replay {
                (fact("Method", html! { "each sample launches the same rays of each bounce once more" }))
            }
            (fact("Before them", html! { (run.warm_up) " to warm up" }))
            (fact("Path", html! { "at most " (count(run.depth as usize, "ray")) ", seed " (run.seed) }))
            @if let Some(sweep) = &record.sweep {
                (fact("Sweep", html! {
                    (text(&sweep.title)) ": " (grouped(sweep.points)) " points, varying "
                    @if sweep.axes.is_empty() { "nothing" } @else { (sweep.axes.join(", ")) }
                    ", order " (sweep.order_seed)
                    @if let Some(shard) = &sweep.shard { ", shard " (shard) }
                }))
            }
        }
        (parts(record))
        details {
            summary { "Parameters of the run (" (record.parameters.0.len()) ")" }
            (parameters(&record.parameters))
        }
        details {
            summary { "Shaders (" (record.shaders.len()) ")" }
            @if record.shaders.is_empty() { p { (gap("not recorded")) } }
            dl.facts { @for (name, hash) in &record.shaders { (fact(name, html! { code { (hash) } })) } }
        }
    }
}

/// A name and what is known about it.
pub fn fact(name: &str, about: Markup) -> Markup {
    html! { div { dt { (name) } dd { (about) } } }
}

/// Parameters and their values.
pub fn parameters(parameters: &Parameters) -> Markup {
    html! {
        @if parameters.0.is_empty() { p { (gap("none")) } } @else {
            dl.facts { @for (name, value) in &parameters.0 { (fact(name, html! { (select::text(value)) })) } }
        }
    }
}

/// A command line, so that a shell would understand it.
fn command(words: &[String]) -> Markup {
    let quoted = |word: &String| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_=./:,+@%".contains(c);
        if !word.is_empty() && word.chars().all(plain) {
            word.clone()
        } else {
            format!("'{}'", word.replace('\'', r"'\''"))
        }
    };
    if words.is_empty() {
        return gap("not recorded");
    }
    html! { code { (words.iter().map(quoted).collect::<Vec<_>>().join(" ")) } }
}

/// The processes that measured, where there were several.
fn parts(record: &Record) -> Markup {
    html! {
        @if record.parts.len() > 1 {
            div.scroll role="region" tabindex="0" aria-label="Parts" {
                table {
                    caption { "Measured by " (record.parts.len()) " processes" }
                    thead { tr {
                        th scope="col" { "part" } th scope="col" { "shard" } th scope="col" { "device" }
                        th scope="col" { "driver" } th scope="col" { "CPU" } th scope="col" { "from" } th scope="col" { "to" }
                    } }
                    tbody {
                        @for (index, part) in record.parts.iter().enumerate() {
                            tr {
                                th scope="row" { (index + 1) }
                                td { (part.shard.as_deref().unwrap_or("all")) }
                                td { (part.device) } td { (part.driver) } td { (part.host.cpu) }
                                td { (part.started) } td { (part.finished) }
                            }
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_can_be_given_to_a_shell() {
        let words = ["runner", "run", "--variant", "Wide4 CBTC", "it's"].map(String::from);
        let shown = command(&words).into_string();
        assert!(shown.contains(r"runner run --variant 'Wide4 CBTC' 'it'\''s'"), "{shown}");
    }
}
