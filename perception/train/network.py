"""PyramidCNN: VGG-16 features and two fully convolutional heads (Chen et al. 2019, section Object Detection).

The topology is VGG-16's; to run on two CPU cores it has a quarter of its width, and the last two poolings are left out, so that
a cell of the heat map is 8 pixels and not 32. Batch normalisation stands between convolution and ReLU while training and is
folded into the convolutions on export.
"""

import math

import torch
from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

CONVOLUTIONS = (2, 2, 3, 3, 3)
WIDTHS = (64, 128, 256, 512, 512)
POOLED = (True, True, True, False, False)
STRIDE = 8
# Mean and spread of colours in [0, 1].
MEAN, SPREAD = 0.45, 0.25


def block(inputs, outputs, kernel=3):
    """Convolution, normalisation, ReLU."""
    convolution = nn.Conv2d(inputs, outputs, kernel, padding=kernel // 2, bias=False)
    return [convolution, nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)]


class PyramidCNN(nn.Module):
    """Maps images (N, 3, H, W), RGB in [0, 1], to logits of classes (N, 1 + objects, H/8, W/8), background first, and of aspect
    ratios (N, 7, H/8, W/8)."""

    def __init__(self, objects, ratios, width=0.25):
        super().__init__()
        layers, channels = [], 3
        for convolutions, full, pooled in zip(CONVOLUTIONS, WIDTHS, POOLED):
            outputs = int(full * width)
            for _ in range(convolutions):
                layers += block(channels, outputs)
                channels = outputs
            if pooled:
                layers.append(nn.MaxPool2d(2))
        self.features = nn.Sequential(*layers)
        self.classes = nn.Sequential(*block(channels, channels), nn.Conv2d(channels, 1 + objects, 1))
        self.shapes = nn.Sequential(*block(channels, channels), nn.Conv2d(channels, ratios, 1))
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
        # Nearly every cell is background: begin there, or the first steps are spent on learning it.
        nn.init.normal_(self.classes[-1].weight, std=0.01)
        nn.init.normal_(self.shapes[-1].weight, std=0.01)
        nn.init.zeros_(self.classes[-1].bias)
        nn.init.zeros_(self.shapes[-1].bias)
        self.classes[-1].bias.data[0] = math.log(100 * objects)

    def forward(self, images):
        features = self.features((images - MEAN) / SPREAD)
        return self.classes(features), self.shapes(features)


class Exported(nn.Module):
    """What the ONNX file holds: the network without normalisation layers, and with softmax on both heads."""

    def __init__(self, network):
        super().__init__()
        network = network.eval()
        self.features = folded(network.features)
        self.classes = folded(network.classes)
        self.shapes = folded(network.shapes)

    def forward(self, images):
        features = self.features((images - MEAN) / SPREAD)
        return torch.softmax(self.classes(features), 1), torch.softmax(self.shapes(features), 1)


def folded(layers):
    """The same layers with every batch normalisation folded into the convolution before it."""
    out = []
    for layer in layers:
        if isinstance(layer, nn.BatchNorm2d):
            out[-1] = fuse_conv_bn_eval(out[-1], layer)
        else:
            out.append(layer)
    return nn.Sequential(*out)
